// SPDX-License-Identifier: GPL-3.0-or-later
// Keeps a watcher's lease at a board. A part of a session, without I/O.
//         +--+ STALE: its LEASE is echoed
//         v  |          states come
//        asking ------------------------> watching <--states come-- full, unknown
//         |                                                              ^
//         +----------- BUSY: full; refused otherwise: unknown -----------+
//
//     asking    W is sent every 500 ms; at once with a LEASE to echo, or when a transport comes up
//     watching  W is sent as in `asking`, because a lease lasts 2 s. After 1 s without a state, a
//               refusal has the same effect as in `asking`
//     full      the board has no room for another watcher; W is sent once a second
//     unknown   the board does not support watchers; W is sent once a second, because another board
//               may replace it
#pragma once

#include <cstdint>
#include <optional>

#include "r4link/link.hpp"

namespace r4 {

class Lease {
 public:
  bool due(Time now) const { return now >= next_; }
  Time next() const { return next_; }
  void sent(Time now) {
    const bool hopeless = state_ == State::full || state_ == State::unknown;
    next_ = now + (hopeless ? reminder : renewal);
  }
  void renew(Time now) { next_ = now; }
  std::uint32_t echo() const { return echo_; }

  void on_state(Time now) {
    state_ = State::watching;
    heard_ = now;
  }
  void on_refusal(const Nack& nack, Time now) {
    if (nack.lease != 0) {
      echo_ = nack.lease;
      renew(now);
    } else if (!streaming(now)) {  // otherwise the states are for the controlling host
      state_ = nack.code == Refusal::busy ? State::full : State::unknown;
    }
  }
  bool streaming(Time now) const { return state_ == State::watching && now - heard_ < silence; }
  std::optional<LinkCause> cause(Time now) const {
    if (streaming(now)) return std::nullopt;
    if (state_ == State::full) return LinkCause::watchers_full;
    return state_ == State::unknown ? std::optional(LinkCause::not_watchable) : std::nullopt;
  }

 private:
  enum class State : std::uint8_t { asking, watching, full, unknown };
  static constexpr Time renewal = std::chrono::milliseconds{500};
  static constexpr Time reminder = std::chrono::seconds{1};
  static constexpr Time silence = std::chrono::seconds{1};

  State state_ = State::asking;
  Time next_{0};
  Time heard_{0};
  std::uint32_t echo_ = 0;
};

}  // namespace r4
