// SPDX-License-Identifier: GPL-3.0-or-later
// When the next state datagram is due: a fixed grid in time, so that lateness never adds up.
#pragma once

#include <cstdint>

#include "../../protocol/datagram/wrapping.hpp"

namespace r4 {
namespace firmware {

class StateSchedule {
 public:
  // Begins the grid: the first state is due at once.
  void start(std::uint32_t now_ms, std::uint32_t period_ms) {
    next_ms_ = now_ms;
    period_ms_ = period_ms;
    running_ = true;
  }
  void stop() { running_ = false; }
  bool running() const { return running_; }

  // Another period from the next state on.
  void set_period(std::uint32_t period_ms) { period_ms_ = period_ms; }

  // Takes a due state: true, with its time on the grid in `t_ms`. Whole periods that have passed
  // unserved are left out and counted.
  bool take(std::uint32_t now_ms, std::uint32_t& t_ms) {
    if (!running_ || !reached(now_ms, next_ms_)) return false;
    const std::uint32_t missed = (now_ms - next_ms_) / period_ms_;
    late_ += missed;
    t_ms = next_ms_ + missed * period_ms_;
    next_ms_ = t_ms + period_ms_;
    return true;
  }

  // Milliseconds until the next one; only while running.
  std::uint32_t due_in(std::uint32_t now_ms) const {
    return reached(now_ms, next_ms_) ? 0 : next_ms_ - now_ms;
  }

  std::uint32_t late() const { return late_; }  // states left out since boot

 private:
  std::uint32_t next_ms_ = 0;
  std::uint32_t period_ms_ = 10;
  std::uint32_t late_ = 0;
  bool running_ = false;
};

}  // namespace firmware
}  // namespace r4
