// SPDX-License-Identifier: GPL-3.0-or-later
// A clock that runs while this computer sleeps, and a detector of sleeps. While a computer is
// suspended, the steady clock (CLOCK_MONOTONIC) stops, with every timer and deadline. The boot
// clock (CLOCK_BOOTTIME) continues, so it measures real time.
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

// The time for which this computer has slept since power-on: the boot clock's lead over the steady
// clock. Two bounds, because the thread may be preempted between reading the clocks.
inline Time slept_at_most(Time steady) {
  return std::chrono::duration_cast<Time>(BootClock::now().time_since_epoch()) - steady;
}
inline Time slept_at_least() {
  const auto boot = BootClock::now().time_since_epoch();
  return std::chrono::duration_cast<Time>(boot -
                                          std::chrono::steady_clock::now().time_since_epoch());
}

// A delayed thread or a stopped process does not count as a sleep.
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
  // The least time of sleep since construction or the last true.
  Time time() const { return std::max(slept_at_least() - before_, Time{0}); }

 private:
  Time before_ = slept_at_most(
      std::chrono::duration_cast<Time>(std::chrono::steady_clock::now().time_since_epoch()));
};

}  // namespace r4
