// SPDX-License-Identifier: GPL-3.0-or-later
// Who watches the board without controlling it: up to four leases (docs/protocol.md "Watching").
//
//     nobody --W:rate that echoes its token--> watching --lease_ms without one, or W:0--> nobody
//        |  ^                                   |  ^
//        +--+ any other W: sent a token         +--+ W:rate that echoes the token: renewed
//
// Nothing streams to a place before it has echoed the token, a random number, that it was sent itself: so
// nobody who forges where a W comes from makes the board flood a stranger, or go on to. (The board's clock
// would not do: it tells that to anyone who asks.) The answers with a token are few, however many ask.
//
// All times are the board's clock in ms, which wraps.
#pragma once

#include <cstdint>

#include "board_link.hpp"
#include "r4link/state.hpp"

namespace r4 {

struct Watcher {
  Source at;
  std::uint32_t token = 0;
  std::uint32_t pnum = 0;       // of the next datagram that goes to it alone
  std::uint32_t period_ms = 0;  // between its states; 0: this place is free
  std::uint32_t renewed_ms = 0;
  std::uint32_t next_ms = 0;  // when its next state is due
  bool chooses = false;       // its fields
  FieldSet fields;

  // Takes the state of that time, if one is due.
  bool take(std::uint32_t t_ms) {
    if (!reached(t_ms, next_ms)) return false;
    const std::uint32_t behind = t_ms - next_ms;
    next_ms += behind < period_ms ? period_ms : behind + period_ms;  // none are made up for
    return true;
  }
};

class Watchers {
 public:
  static constexpr int places = 4;
  static constexpr std::uint32_t lease_ms = 2000;
  // Between two tokens told.
  static constexpr std::uint32_t answer_spacing_ms = 20;

  enum class Effect : std::uint8_t {
    watching,  // from now on, or on
    ended,
    unproven,  // it is to be sent a token, by tell()
    ignored,   // so was another just now, or it ends nothing
    full,      // others have all the places
  };
  // `W:rate` of a place; 0 ends its lease. `echo`: its T. `proven`: it need echo nothing, for it can be nowhere
  // else (a bus).
  Effect on_lease(Source from, std::uint32_t rate_hz, std::uint64_t echo, bool proven,
                  std::uint32_t now_ms);
  // That place is sent this token, which nobody else can know. It is good for lease_ms, and then as long
  // as the lease.
  void tell(Source to, std::uint32_t token, std::uint32_t now_ms);

  // Lets time pass: leases end.
  void poll(std::uint32_t now_ms);

  // That place's lease is over: it controls the board, and gets everything.
  void end_of(Source at);

  // That place's lease; null if it has none.
  Watcher* find(Source at);
  bool any() const;

  // All places, the free ones too (period_ms 0).
  Watcher* begin() { return watchers_; }
  Watcher* end() { return watchers_ + places; }

 private:
  struct Told {
    Source at;
    std::uint32_t token = 0;
    std::uint32_t at_ms = 0;
  };
  static constexpr std::uint32_t told_count = 8;

  bool is_told(Source from, std::uint64_t echo, std::uint32_t now_ms) const;

  Watcher watchers_[places];
  Told told_[told_count];
  std::uint32_t tokens_ = 0;  // how many were told
};

}  // namespace r4
