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
// its farewell, and when the board does not take that host: it has not streamed for `unanswered`,
// or, to a host that it has never streamed to, for `untaken` (a board takes a host at once, or
// never: the host has no key). Other hosts' heartbeats and commands do not pass meanwhile. The
// board begins a new session with the next host, outputs off, because its packet numbers do not go
// on.
//
// A host that the board did not take steps back: it gets the free place only if no other host has
// asked for it for `courtesy`. So up to `remembered` hosts without a key, in turn, cannot keep out
// the one that has it.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "r4link/vocabulary.hpp"

namespace r4 {

class BridgeControl {
 public:
  using Time = std::chrono::steady_clock::time_point;
  // A board streams once a second at least.
  static constexpr std::chrono::milliseconds unanswered{3000};
  static constexpr std::chrono::milliseconds untaken{1000};
  static constexpr std::chrono::milliseconds courtesy{500};
  static constexpr std::size_t remembered = 16;

  // `timeout`: the board's.
  explicit BridgeControl(std::chrono::milliseconds timeout) : timeout_(timeout) {}

  // A heartbeat of that host: does it pass?
  bool on_heartbeat(Peer from, Time now);
  // Do its commands?
  bool has_place(Peer host) const { return host_ == host; }
  // True while a host has the place, and keeps it.
  bool is_taken(Time now) const { return host_ && !free(now); }
  // True if another host has the place, and keeps it.
  bool keeps_out(Peer host, Time now) const { return host_ != host && is_taken(now); }
  // The host that has the place has sent a command or a question of that number.
  void on_number(std::uint32_t pnum) { numbers_[next_number_++ % numbers_.size()] = pnum; }
  // True if that is a number of the host that has the place: an answer to it is for that host.
  bool has_sent(std::uint32_t pnum) const;
  // The host that has the place has sent its farewell, and it has passed.
  void on_farewell() { leaving_ = true; }

  // The board says by a heartbeat that it has no host.
  void on_no_host() { left_ = leaving_; }
  // It streams to the host that has the place.
  void on_state(Time now) {
    streamed_ = now;
    streams_ = true;
  }
  // True once it has.
  bool streams() const { return streams_; }

  const std::optional<Peer>& host() const { return host_; }

 private:
  bool free(Time now) const;
  bool stepped_back(Peer host) const;

  const std::chrono::milliseconds timeout_;
  std::optional<Peer> host_;
  Time heard_;     // the host
  Time streamed_;  // the board last, or when the host got the place
  bool streams_ = false;
  bool leaving_ = false;
  bool left_ = false;
  std::array<std::uint32_t, 256>
      numbers_{};  // of the host: more than it sends before an answer comes
  std::size_t next_number_ = 0;
  std::array<std::optional<Peer>, remembered> stepped_back_;
  std::size_t next_stepped_back_ = 0;
  Time asked_;  // for the place, in vain, by a host that has not stepped back
};

}  // namespace r4
