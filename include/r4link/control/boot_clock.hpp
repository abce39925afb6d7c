// SPDX-License-Identifier: GPL-3.0-or-later
// A clock that goes on while this computer sleeps, and a watch that notices a sleep.
//
// In a suspended computer the steady clock (CLOCK_MONOTONIC) stands still, and every timer and
// deadline with it. The boot clock (CLOCK_BOOTTIME) goes on. It measures periods that must end in a
// human's time.
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

// How long this computer has slept since it was switched on: the boot clock is ahead of the steady
// clock by that. The two are read one after the other, and a thread may lose its processor in
// between.
inline Time slept_at_most(Time steady) {
  return std::chrono::duration_cast<Time>(BootClock::now().time_since_epoch()) - steady;
}
inline Time slept_at_least() {
  const auto boot = BootClock::now().time_since_epoch();
  return std::chrono::duration_cast<Time>(boot -
                                          std::chrono::steady_clock::now().time_since_epoch());
}

// A thread without a processor and a stopped process are not mistaken for a sleep.
class SleepWatch {
 public:
  // `steady` is the steady clock now. True if the computer slept for longer than `limit` since this
  // was made, or since it was last true.
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
  // How long it has slept since then, at least.
  Time time() const { return std::max(slept_at_least() - before_, Time{0}); }

 private:
  Time before_ = slept_at_most(
      std::chrono::duration_cast<Time>(std::chrono::steady_clock::now().time_since_epoch()));
};

}  // namespace r4
