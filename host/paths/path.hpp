// SPDX-License-Identifier: GPL-3.0-or-later
// One path of a session (paths.hpp): its transport, the board at its end, and that board's clock.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "../measurement/identity_question.hpp"
#include "../measurement/time.hpp"
#include "lease.hpp"

namespace r4 {

using PathSet = std::uint8_t;
constexpr PathSet path_bit(std::size_t index) { return static_cast<PathSet>(1U << index); }

// The board's T, extrapolated from a received T: late by the datagram's delay, never ahead.
struct PathClock {
  std::uint32_t board_ms = 0;  // the board's T at at_ms
  std::uint32_t at_ms = 0;

  // How far `t_ms` is ahead of this clock at the time `at`, in ms.
  std::int32_t ahead(std::uint32_t t_ms, Time at) const {
    return static_cast<std::int32_t>(t_ms - (board_ms + (to_ms(at) - at_ms)));
  }
  // True if a T sent after `since` may be of this boot: at most `late_ms` late, not in the future.
  bool fits(std::uint32_t t_ms, Time since, Time now, std::int32_t late_ms) const {
    return ahead(t_ms, since) >= -late_ms && ahead(t_ms, now) <= tolerance_ms;
  }

  // A larger difference means another boot.
  static constexpr std::int32_t tolerance_ms = 10'000;
  // The allowed delay of a T after a heartbeat `PNum:0;T:0`, or in an answer. Small, because the
  // paper's boards count T from 0: after a quick restart, T is only slightly smaller.
  static constexpr std::int32_t restart_tolerance_ms = 1'000;
};

struct PathQuestions {
  IdentityQuestion open;
  bool answered = false;  // since the transport went up
  bool in_doubt = false;  // a T that does not fit arrived after the newest question
  int unanswered = 0;     // questions in doubt since the last answer
  Time asked_at{0};
  Time ask_at{0};
  Time round_trip{0};
};

struct PathBusy {
  Time until{0};
  // T of the board's newest BUSY; empty if the transport received another host's frames.
  std::optional<std::uint32_t> board_ms;
};

struct Path {
  bool up = false;
  bool can_ask = true;
  bool known = false;       // leads to the session's board
  bool other = false;       // leads to another board
  bool connecting = false;  // the last heartbeat had `PNum:0`
  std::uint32_t boot = 0;
  std::optional<PathClock> clock;
  Time heard{0};
  Time heard_until{0};
  PathQuestions questions;
  PathBusy busy;
  Lease lease;
  std::string board_id;
};

}  // namespace r4
