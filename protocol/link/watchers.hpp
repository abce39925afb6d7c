// SPDX-License-Identifier: GPL-3.0-or-later
// The watchers' leases at a board or bridge, up to four (docs/reference/protocol.md "Watching").
//     free --W:rate that echoes its token--> watching --lease_ms without one, or W:0--> free
//       |  ^                                   |  ^
//       +--+ any other W: send a token         +--+ W:rate that echoes the token: renewed
//
// The board streams to a source only after the source has echoed a random token, so a forged source
// cannot make the board flood another device. The board's clock cannot be the token, because any
// peer can get the time. Answers with a token are limited. Times are in ms, and wrap.
#pragma once

#include <cstdint>

#include "board_link.hpp"
#include "r4link/state.hpp"

namespace r4 {

struct Watcher {
  Source at;
  std::uint32_t token = 0;
  std::uint32_t pnum = 0;       // number of the next datagram for this watcher alone
  std::uint32_t period_ms = 0;  // time between two states; 0: free
  std::uint32_t renewed_ms = 0;
  std::uint32_t next_ms = 0;
  bool chooses = false;  // true if the watcher chose its fields
  FieldSet fields;

  // True if a state is due at `t_ms`; then schedules the next state.
  bool take(std::uint32_t t_ms) {
    if (!reached(t_ms, next_ms)) return false;
    const std::uint32_t behind = t_ms - next_ms;
    next_ms += behind < period_ms ? period_ms : behind + period_ms;  // missed states are skipped
    return true;
  }
};

class Watchers {
 public:
  static constexpr int places = 4;
  static constexpr std::uint32_t lease_ms = 2000;
  // The least time between two tokens.
  static constexpr std::uint32_t answer_spacing_ms = 20;

  enum class Effect : std::uint8_t {
    watching,  // the lease began or was renewed
    ended,
    unproven,  // send the source a token, with tell()
    ignored,   // a token was sent just before, or W:0 ends no lease
    full,      // other watchers have all the places
  };
  // 0 Hz ends the lease. `echo`: the T of W. `proven`: the source cannot be forged (a bus).
  Effect on_lease(Source from, std::uint32_t rate_hz, std::uint64_t echo, bool proven,
                  std::uint32_t now_ms);
  // The secret `token` was sent to `to`. It is valid for lease_ms, then as long as the lease.
  void tell(Source to, std::uint32_t token, std::uint32_t now_ms);

  void poll(std::uint32_t now_ms);

  // The source controls the board and receives everything, so its lease ends.
  void end_of(Source at);

  Watcher* find(Source at);
  bool any() const;

  // All places, including free places (period_ms 0).
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
  std::uint32_t tokens_ = 0;
};

}  // namespace r4
