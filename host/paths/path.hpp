// SPDX-License-Identifier: GPL-3.0-or-later
// One path of a session (paths.hpp): its transport, the board at its end, and that board's clock.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "../measurement/identity_question.hpp"
#include "../measurement/time.hpp"

namespace r4 {

// A set of paths: bit i is the path i.
using PathSet = std::uint8_t;
constexpr PathSet path_bit(std::size_t index) { return static_cast<PathSet>(1U << index); }

// The board's T as extrapolated from a received T. A T arrives after the board sent it, so this
// clock is never ahead of the board's, and it lags by the delay of that datagram.
class PathClock {
 public:
  bool known() const { return known_; }
  void forget() { known_ = false; }
  void set(std::uint32_t t_ms, Time now) {
    known_ = true;
    board_ms_ = t_ms;
    at_ms_ = to_ms(now);
  }
  // By how many ms `t_ms` is ahead of this clock at that time.
  std::int32_t ahead(std::uint32_t t_ms, Time at) const {
    return static_cast<std::int32_t>(t_ms - (board_ms_ + (to_ms(at) - at_ms_)));
  }
  // True if a T that arrives now, and was sent after `since`, may be of this boot: at most
  // `late_ms` late, and not from the future.
  bool fits(std::uint32_t t_ms, Time since, Time now, std::int32_t late_ms) const {
    return ahead(t_ms, since) >= -late_ms && ahead(t_ms, now) <= tolerance_ms;
  }

  // A T further off than this is of another boot.
  static constexpr std::int32_t tolerance_ms = 10'000;
  // How late a T may be after a heartbeat `PNum:0;T:0`, or in an answer to a question. The paper's
  // boards count T from 0 at each boot, so T is only a little smaller after a quick restart.
  static constexpr std::int32_t restart_tolerance_ms = 1'000;

 private:
  bool known_ = false;
  std::uint32_t board_ms_ = 0;  // its T at at_ms_
  std::uint32_t at_ms_ = 0;
};

// The questions Q:ID on a path.
struct PathQuestions {
  IdentityQuestion open;
  bool answered = false;  // at least one, since the transport came up
  bool in_doubt = false;  // a datagram has come since the newest question, and its T did not fit
  int unanswered = 0;     // since the last answer, of those asked in doubt
  Time asked_at{0};
  Time ask_at{0};
  Time round_trip{0};
};

// BUSY on a path.
struct PathBusy {
  Time until{0};
  // The board's T of its newest BUSY; none if this program's transport heard another host.
  std::optional<std::uint32_t> board_ms;
};

struct Path {
  bool up = false;
  bool can_ask = true;
  bool known = false;       // leads to the session's board
  bool other = false;       // leads to another board
  bool connecting = false;  // its last heartbeat was `PNum:0`
  std::uint32_t boot = 0;
  PathClock clock;
  Time heard{0};
  Time heard_until{0};
  PathQuestions questions;
  PathBusy busy;
  std::string board_id;
};

}  // namespace r4
