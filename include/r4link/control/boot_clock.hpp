// SPDX-License-Identifier: GPL-3.0-or-later
// A clock that runs while this computer sleeps, and a watch that notices a sleep. In a suspended
// computer the steady clock (CLOCK_MONOTONIC) stands still, with every timer and deadline. The boot
// clock (CLOCK_BOOTTIME) runs: it measures periods in a human's time.
#pragma once

#include <algorithm>
#include <chrono>
#include <ctime>

#include "../link.hpp"

namespace r4 {

struct BootClock {
  using duration = std::chrono::nanoseconds;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<BootClock>;
  static constexpr bool is_steady = true;

  static time_point now() noexcept {
    timespec time{};
    clock_gettime(CLOCK_BOOTTIME, &time);
    return time_point(std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec));
  }
};

// How long this computer has slept since power-on: the boot clock's lead over the steady clock. The
// clocks are read one after the other, and the thread may be preempted in between.
inline Time slept_at_most(Time steady) {
  return std::chrono::duration_cast<Time>(BootClock::now().time_since_epoch()) - steady;
}
inline Time slept_at_least() {
  const auto boot = BootClock::now().time_since_epoch();
  return std::chrono::duration_cast<Time>(boot -
                                          std::chrono::steady_clock::now().time_since_epoch());
}

// Does not mistake a thread without a processor or a stopped process for a sleep.
class SleepWatch {
 public:
  // True if the computer slept longer than `limit` since construction or the last true.
  bool slept(Time steady, Time limit) {
    const Time most = slept_at_most(steady);
    if (most - before_ <= limit) {
      before_ = std::min(before_, most);
      return false;
    }
    if (slept_at_least() - before_ <= limit) return false;
    before_ = most;
    return true;
  }
  // The least time that it slept since then.
  Time time() const { return std::max(slept_at_least() - before_, Time{0}); }

 private:
  Time before_ = slept_at_most(
      std::chrono::duration_cast<Time>(std::chrono::steady_clock::now().time_since_epoch()));
};

}  // namespace r4
