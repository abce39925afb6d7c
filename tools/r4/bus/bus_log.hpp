// SPDX-License-Identifier: GPL-3.0-or-later
// What was said on the CAN buses of a dump by candump: the datagrams of every node, joined by the
// ISO-TP receivers that boards and hosts have, and the raw frames, as JSON objects
// (`r4 decode --candump`, docs/can.md).
//
// Receivers only listen: one for each interface, node and lane that occurs. Time is the dump's.
// Memory is bounded by max_interfaces, whatever comes in.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "../shell/json.hpp"
#include "candump.hpp"
#include "r4link/datagram.hpp"
#include "transports/framing/can/can_ids.hpp"
#include "transports/framing/can/isotp_receiver.hpp"

namespace r4::tool {

class BusLog {
 public:
  static constexpr std::size_t max_interfaces = 32;
  using Print = std::function<void(const Json&)>;

  explicit BusLog(Print print) : print_(std::move(print)) {}

  // A line of the dump, not empty. Prints what it completes or ends.
  void on_line(std::uint64_t number, std::string_view text);
  // A line that is too long to be one of candump.
  void on_long_line(std::uint64_t number, std::uint64_t size);
  // The dump is over: prints the summary.
  void finish();

  // Was there a damaged line, a transfer that failed, or a datagram that is none?
  bool any_bad() const { return damaged_ + failed_ + bad_ != 0; }

 private:
  // Where and when a frame was.
  struct Place {
    std::uint64_t line = 0;
    Json time;
    std::optional<std::uint64_t> time_us;
  };
  struct Lane {
    explicit Lane(const CanIdMeaning& meaning);

    std::array<std::uint8_t, max_datagram> bytes;
    IsotpReceiver receiver;
    Json whose;                // interface, node, from, lane
    bool answered = false;     // the other end has sent flow control
    std::uint32_t frames = 0;  // of the transfer so far
    Place first, last;
  };
  struct Interface {
    std::string name;
    // By node: command, reply, telemetry; made when they are first used.
    std::array<std::array<std::unique_ptr<Lane>, 3>, can_nodes> lanes;
  };

  void on_frame(const CandumpLine& line, const Place& place);
  void on_lane_frame(Interface& interface, const CanIdMeaning& meaning, const CanFrame& frame,
                     const Place& place);
  void on_raw_frame(const Interface& interface, const CanIdMeaning& meaning, const CanFrame& frame,
                    const Place& place);
  Interface* interface_of(std::string_view name);
  Lane& lane_of(Interface& interface, const CanIdMeaning& meaning);
  void pass_time(const std::optional<std::uint64_t>& time_us);
  void end_late_transfers();
  void report_datagram(const Lane& lane);
  void report_failure(const Lane& lane, const Place& place, IsotpError error);
  void report_damage(std::uint64_t number, const char* reason, const char* fix, Json rest);

  Print print_;
  std::list<Interface> interfaces_;
  std::vector<Lane*> lanes_;  // all of them
  std::uint32_t now_us_ = 0;
  std::optional<std::uint64_t> last_time_us_;
  IsotpDeadline earliest_{false, 0};  // no transfer times out before

  std::uint64_t frames_ = 0;
  std::uint64_t datagrams_ = 0;  // whole ones, good or bad
  std::uint64_t bad_ = 0;        // of those
  std::uint64_t failed_ = 0;     // transfers, and frames that no transfer can have
  std::uint64_t raw_ = 0;        // emergency stops and boards that went safe
  std::uint64_t flow_control_ = 0;
  std::uint64_t orphans_ = 0;       // frames of transfers that were not heard from their beginning
  std::uint64_t other_ = 0;         // frames that are none of ours
  std::uint64_t error_frames_ = 0;  // of the controller
  std::uint64_t damaged_ = 0;       // lines
};

}  // namespace r4::tool
