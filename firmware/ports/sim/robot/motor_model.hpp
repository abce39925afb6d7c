// SPDX-License-Identifier: GPL-3.0-or-later
// A brushed DC motor on an H-bridge, in integers: the speed follows the duty with a time constant
// of 256 ms. The current follows the difference between commanded and actual speed.
#pragma once

#include <cstdint>

#include "r4link/vocabulary.hpp"

namespace r4 {
namespace sim {

class MotorModel {
 public:
  static constexpr std::int32_t top_speed = 4000;         // counts a second, at full duty
  static constexpr std::int32_t stall_current_ca = 3000;  // hundredths of an ampere, at full duty

  void stop() { speed_q12_ = 0; }

  // Returns the counts turned, forward positive.
  std::int32_t pass_millisecond(Drive drive) {
    const std::int32_t duty = drive.direction == Direction::forward ? drive.pwm : -drive.pwm;
    duty_ = duty;
    const std::int32_t wanted_q12 = duty * (top_speed * 4096 / pwm_max);
    // The last step is the whole difference, so that a motor without current stops.
    const std::int32_t missing_q12 = wanted_q12 - speed_q12_;
    const std::int32_t step = missing_q12 / 256;
    speed_q12_ += step != 0 ? step : missing_q12;
    part_ += speed_q12_;
    const std::int32_t counts = part_ / counts_q12;
    part_ -= counts * counts_q12;
    return counts;
  }

  std::int32_t speed() const { return speed_q12_ / 4096; }  // counts a second
  // Hundredths of an ampere from the battery, in proportion to the duty.
  std::int32_t current_ca() const {
    const std::int32_t missing = duty_ * top_speed / pwm_max - speed();
    const std::int32_t winding_ca = missing * stall_current_ca / top_speed;
    return duty_ * winding_ca > 0 ? (duty_ < 0 ? -duty_ : duty_) *
                                        (winding_ca < 0 ? -winding_ca : winding_ca) / pwm_max
                                  : 0;
  }

 private:
  static constexpr std::int32_t counts_q12 = 4096 * 1000;  // 1000 steps per second

  std::int32_t duty_ = 0;       // -4095 to 4095
  std::int32_t speed_q12_ = 0;  // counts a second, times 4096
  std::int32_t part_ = 0;       // fraction of a count, in 1/counts_q12
};

}  // namespace sim
}  // namespace r4
