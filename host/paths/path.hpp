// SPDX-License-Identifier: GPL-3.0-or-later
// One of the paths of a session: its transport, whose board it leads to, and what it has brought (paths.hpp).
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "../measurement/identity_question.hpp"
#include "../measurement/time.hpp"

namespace r4 {

// A set of paths: bit i is the path i.
using PathSet = std::uint8_t;
constexpr PathSet path_bit(std::size_t index) { return static_cast<PathSet>(1U << index); }

// The board's T as it should be now, by one that was heard. It is never ahead of the board, for each T comes
// after it was shown, and behind it by what the network held that one back.
class PathClock {
 public:
  bool known() const { return known_; }
  void forget() { known_ = false; }
  void set(std::uint32_t t_ms, Time now) {
    known_ = true;
    board_ms_ = t_ms;
    at_ms_ = to_ms(now);
  }
  // How far `t_ms` is ahead of what it should be at that time, in ms.
  std::int32_t ahead(std::uint32_t t_ms, Time at) const {
    return static_cast<std::int32_t>(t_ms - (board_ms_ + (to_ms(at) - at_ms_)));
  }
  // May the board show `t_ms` at that time, if it may be this much late?
  bool fits(std::uint32_t t_ms, Time now, std::int32_t late_ms) const {
    const std::int32_t off = ahead(t_ms, now);
    return off >= -late_ms && off <= tolerance_ms;
  }
  // The same between `since` and `now`.
  bool fits(std::uint32_t t_ms, Time since, Time now, std::int32_t late_ms) const {
    return ahead(t_ms, since) >= -late_ms && ahead(t_ms, now) <= tolerance_ms;
  }

  // A T this far from where the board's clock should be is of another boot.
  static constexpr std::int32_t tolerance_ms = 10'000;
  // This far behind, if the board has said that it is booting (`PNum:0;T:0`), which a network may also have
  // held back since the boot before, or if it has answered a question: the paper's boards begin at 0 each time, so
  // their T after a quick restart is not far off.
  static constexpr std::int32_t restart_tolerance_ms = 1'000;

 private:
  bool known_ = false;
  std::uint32_t board_ms_ = 0;  // its T at at_ms_
  std::uint32_t at_ms_ = 0;
};

// The questions who its board is (Q:ID) that were sent on a path.
struct PathQuestions {
  IdentityQuestion open{Time{0}};
  bool answered = false;  // one was, since the transport has come
  int unanswered = 0;     // since then
  Time asked_at{0};
  Time ask_at{0};
  Time round_trip{0};
};

// Where a path has answered BUSY.
struct PathBusy {
  Time until{0};
  bool here = false;           // our own end hears another host in our place
  std::uint32_t board_ms = 0;  // else the board's T of the newest BUSY
};

struct Path {
  bool up = false;
  bool can_ask = true;
  bool known = false;       // its board is the session's
  bool other = false;       // it is not
  bool connecting = false;  // said so last
  std::uint32_t boot = 0;
  PathClock clock;
  Time heard{0};
  Time heard_until{0};  // silent from then on
  PathQuestions questions;
  PathBusy busy;
  std::string board_id;
};

}  // namespace r4
