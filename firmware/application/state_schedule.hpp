// SPDX-License-Identifier: GPL-3.0-or-later
// Schedules states on a fixed time grid, so that delays do not add up.
#pragma once

#include <cstdint>

#include "../../protocol/datagram/wrapping.hpp"

namespace r4 {
namespace firmware {

class StateSchedule {
 public:
  void start(std::uint32_t now_ms, std::uint32_t period_ms) {
    next_ms_ = now_ms;
    period_ms_ = period_ms;
    running_ = true;
  }
  void stop() { running_ = false; }
  bool running() const { return running_; }

  // Takes effect after the next state.
  void set_period(std::uint32_t period_ms) { period_ms_ = period_ms; }

  // True if a state is due, at `t_ms` on the grid. Skips and counts periods that have passed.
  bool take(std::uint32_t now_ms, std::uint32_t& t_ms) {
    if (!running_ || !reached(now_ms, next_ms_)) return false;
    const std::uint32_t missed = (now_ms - next_ms_) / period_ms_;
    late_ += missed;
    t_ms = next_ms_ + missed * period_ms_;
    next_ms_ = t_ms + period_ms_;
    return true;
  }

  // Call only while running.
  std::uint32_t due_in(std::uint32_t now_ms) const {
    return reached(now_ms, next_ms_) ? 0 : next_ms_ - now_ms;
  }

  std::uint32_t late() const { return late_; }  // states skipped since boot

 private:
  std::uint32_t next_ms_ = 0;
  std::uint32_t period_ms_ = 10;
  std::uint32_t late_ = 0;
  bool running_ = false;
};

}  // namespace firmware
}  // namespace r4
