// SPDX-License-Identifier: GPL-3.0-or-later
// The boards, datagrams and load of a CAN bus. CanSurvey only listens, so it disturbs no host.
//     CanSurvey survey({1000000, 0});
//     survey.on_datagram([](std::uint8_t node, const Datagram& datagram) { … });
//     survey.on_frame(frame, at_us);         // every frame of the bus, see CanListener
//     survey.board(3).states; survey.traffic(); survey.busy_ns();
//
// No I/O, no clock. Memory is bounded: 32 nodes, 2048 11-bit ids, and one entry for all 29-bit ids.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>

#include "../config.hpp"
#include "../datagram.hpp"
#include "../messages/packet_tracker.hpp"
#include "../vocabulary.hpp"
#include "can_bits.hpp"
#include "can_frame.hpp"
#include "can_ids.hpp"

namespace r4 {

struct HeardNode {
  std::uint64_t states = 0;
  std::uint64_t heartbeats = 0;
  std::uint64_t answers = 0;             // N and I
  std::uint64_t commands = 0;            // from the board's hosts, including heartbeats
  std::uint64_t damaged = 0;             // failed transfers and invalid datagrams
  std::uint32_t lost = 0;                // missing packet numbers
  std::uint64_t t_ms = 0;                // T of the newest datagram, the board's clock
  std::uint32_t pnum = 0;                // packet number of the newest datagram
  std::uint32_t heard_us = 0;            // arrival of the newest datagram, on_frame()'s clock
  SafeReason reason = SafeReason::none;  // of the newest heartbeat or went-safe frame
  bool connected = false;                // has a host: sends states or numbered heartbeats

  bool sends_datagrams() const { return states + heartbeats + answers != 0; }
  bool heard() const { return states + heartbeats + answers + damaged != 0; }
};

struct CanTraffic {
  std::uint64_t frames = 0;
  std::uint64_t bits = 0;     // including stuff bits and intermission
  std::uint64_t busy_ns = 0;  // time for which the frames occupied the bus
};

class CanSurvey {
 public:
  // All 29-bit ids count as this id.
  static constexpr std::uint32_t extended_ids = max_can_id + 1;

  // If rate.data is 0, FD frames count as if they did not switch their rate.
  R4LINK_API explicit CanSurvey(CanBitRate rate);
  R4LINK_API ~CanSurvey();
  CanSurvey(const CanSurvey&) = delete;
  CanSurvey& operator=(const CanSurvey&) = delete;

  // Called for each valid datagram of a board, in plain form, and for each stop frame of a host.
  R4LINK_API void on_datagram(std::function<void(std::uint8_t node, const Datagram&)> callback);
  R4LINK_API void on_stop(std::function<void()> callback);

  R4LINK_API void on_frame(const CanFrame& frame, std::uint32_t at_us);

  // True for the emergency stop, and for a command id that has carried R4 datagrams. Other ids of a
  // node: true if its board has sent R4 datagrams.
  R4LINK_API bool is_r4(std::uint32_t id) const;
  const HeardNode& board(std::uint8_t node) const { return boards_[node % can_nodes]; }
  const std::map<std::uint32_t, CanTraffic>& traffic() const { return traffic_; }
  std::uint64_t busy_ns() const { return busy_ns_; }

 private:
  struct Lanes;

  void count(const CanFrame& frame);
  void receive(std::uint8_t node, const CanFrame& frame, CanIdKind kind, std::uint32_t at_us);
  void take(std::uint8_t node, Text bytes, std::uint32_t at_us);

  const CanBitRate rate_;
  std::function<void(std::uint8_t, const Datagram&)> datagram_callback_;
  std::function<void()> stop_callback_;
  std::array<std::unique_ptr<Lanes>, can_nodes> lanes_;  // made at the node's first frame
  std::array<HeardNode, can_nodes> boards_;
  std::map<std::uint32_t, CanTraffic> traffic_;
  std::uint64_t busy_ns_ = 0;
};

}  // namespace r4
