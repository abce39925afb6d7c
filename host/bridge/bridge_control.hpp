// SPDX-License-Identifier: GPL-3.0-or-later
// Which host a bridge lets through to the board: one at a time.
//
// All hosts of a bridge come to the board from the same place, and it would take the commands of one for those of
// another. So the bridge keeps them apart:
//
//              a heartbeat                      a heartbeat of another, when the place is free
//     nobody ---------------> that host has the place ------------------------------------> that other host has it
//
// The place is free again when its host has been silent for the board's timeout, when the board has confirmed
// its farewell, and when the board has not streamed for `unanswered`, for then it does not take that host (it has no
// key). Whoever else sends heartbeats or commands meanwhile is not let through. The board begins a new session with
// the next host, outputs off, because its packet numbers do not go on.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

#include "r4link/vocabulary.hpp"

namespace r4 {

class BridgeControl {
 public:
  using Time = std::chrono::steady_clock::time_point;
  // A board streams once a second at least.
  static constexpr std::chrono::milliseconds unanswered{3000};

  // `timeout`: the board's.
  explicit BridgeControl(std::chrono::milliseconds timeout) : timeout_(timeout) {}

  // A heartbeat of that host: does it pass?
  bool on_heartbeat(Peer from, Time now);
  // Do its commands?
  bool has_place(Peer host) const { return host_ == host; }
  // Has another one the place, and keeps it?
  bool keeps_out(Peer host, Time now) const { return host_ && host_ != host && !free(now); }
  // The host that has the place has sent its farewell, and it has passed.
  void on_farewell() { leaving_ = true; }

  // The board says by a heartbeat that it has no host.
  void on_no_host() { left_ = leaving_; }
  // It streams.
  void on_state(Time now) { streamed_ = now; }

  const std::optional<Peer>& host() const { return host_; }

 private:
  bool free(Time now) const;

  const std::chrono::milliseconds timeout_;
  std::optional<Peer> host_;
  Time heard_;     // the host
  Time streamed_;  // the board last, or when the host got the place
  bool leaving_ = false;
  bool left_ = false;
};

}  // namespace r4
