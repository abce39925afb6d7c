// SPDX-License-Identifier: GPL-3.0-or-later
// The longest time that a datagram may have waited to be read. The datagram arrived after the input
// was last empty: when the carrier reported that, or at the previous tick. All input that waits at
// one tick is read before the next tick. A process without processor time (Ctrl-Z) misses ticks.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

namespace r4 {

// For protocol/, whose milliseconds wrap.
inline std::uint32_t ms_of(std::chrono::steady_clock::duration time) {
  return static_cast<std::uint32_t>(
      std::chrono::duration_cast<std::chrono::milliseconds>(time).count());
}
inline std::uint32_t ms_of(std::chrono::steady_clock::time_point time) {
  return ms_of(time.time_since_epoch());
}

class WaitingTime {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::milliseconds tick_interval{25};

  void begin(Time now) { empty_ = tick_ = now; }
  void on_drained(Time now) { empty_ = now; }
  void on_tick(Time now) {
    empty_ = std::max(empty_, tick_);
    tick_ = now;
  }
  std::chrono::steady_clock::duration at_most(Time now) const { return now - empty_; }

 private:
  Time empty_;  // when the input was last empty
  Time tick_;
};

}  // namespace r4
