// SPDX-License-Identifier: GPL-3.0-or-later
// Separates new datagrams from duplicates, and counts lost datagrams (paths.hpp). T orders the
// datagrams of different paths. Packet numbers order datagrams of one path within a millisecond.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "../../protocol/datagram/wrapping.hpp"
#include "r4link/messages/packet_tracker.hpp"
#include "r4link/state.hpp"

namespace r4 {

class PathNews {
 public:
  explicit PathNews(std::size_t paths) : paths_(paths) {}

  // --- the packet number of each admitted datagram, before the functions below

  void on_number(std::size_t index, std::uint32_t pnum);
  // An answer is always new, but counted only after the first state or heartbeat.
  void on_answer(std::size_t index, std::uint32_t pnum);
  // The next number will be unrelated to the last number.
  void restart(std::size_t index);

  // --- whether a datagram is new: each of these functions also counts it

  // False for a duplicate from another path, and for an older heartbeat.
  bool take_heartbeat(std::size_t path, std::uint32_t t_ms);
  // False if a newer state is known.
  bool is_newest_state(std::size_t path, std::uint32_t t_ms);
  // False for a duplicate: with an equal T, a state is new only if it adds a field.
  bool take_state(std::size_t path, std::uint32_t t_ms, FieldSet present);
  // True if no newer datagram is known: this datagram becomes the newest.
  bool is_newest(std::size_t path, std::uint32_t t_ms);
  // True for a repeated answer: each path may carry an answer to a duplicate of a command.
  bool is_copy(const Nack& nack);

  // The board has restarted: the next T is unrelated to earlier T.
  void forget() { newest_ = {}; }
  // The board is booting: its next heartbeat is new.
  void on_connecting() { newest_.any = newest_.heartbeat = std::nullopt; }

  // For the session: `lost` counts datagrams that arrived on no path.
  const PacketCounters& counters() const { return counters_; }
  const PacketCounters& counters(std::size_t path) const { return paths_[path].tracker.counters(); }
  std::uint64_t copies(std::size_t path) const { return paths_[path].copies; }

 private:
  struct Numbers {
    PacketTracker tracker;
    std::uint32_t pnum = 0;  // of the datagram in process
    Arrival arrival = Arrival::first;
    std::uint32_t gap = 0;     // missing numbers before this datagram
    std::uint32_t others = 0;  // first received on other paths, after this path's newest datagram
    std::uint32_t lost = 0;    // lost datagrams in this path's gaps
    std::uint64_t copies = 0;
  };
  // The newest datagram of a kind, and the path on which it arrived first.
  struct First {
    std::uint32_t t_ms = 0;
    std::uint32_t pnum = 0;
    std::size_t path = 0;
  };
  bool is_new(std::optional<First>& newest, std::size_t path, std::uint32_t t_ms) const;
  void count_new(Numbers& path);
  void count_copy(Numbers& path);
  void count_gap(Numbers& path);
  bool take_back(Numbers& path);

  std::vector<Numbers> paths_;
  struct Newest {
    std::optional<First> any, heartbeat, state;
    FieldSet fields;  // of all states with the T of `state`
  } newest_;
  PacketCounters counters_;
  std::array<std::pair<std::uint32_t, Refusal>, 16> told_{};  // the newest answers
  std::size_t answers_ = 0;
};

}  // namespace r4
