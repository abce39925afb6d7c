// SPDX-License-Identifier: GPL-3.0-or-later
// An H-bridge on two lines of a PCA9685, which change in one transfer:
//     form              first line             second line
//     pwm, direction    duty                   high: forward
//     two-pwm           duty forward           duty in reverse
//
// `inverted` exchanges forward and reverse. Both lines low: no torque.
#pragma once

#include <cstdint>

#include "pca9685.hpp"
#include "r4link/vocabulary.hpp"
#include "r4link/wiring/wiring.hpp"

namespace r4 {
namespace firmware {

class Bridge {
 public:
  // Before connect(), the bridge drives nothing. The chip must outlive the bridge.
  void connect(Pca9685& chip, Place pwm, Place direction) {
    chip_ = &chip;
    first_ = pwm.number() % pca9685_lines;
    second_ = direction.number() % pca9685_lines;
    two_pwm_ = pwm.option();
    inverted_ = direction.option();
    chip.pair(first_, second_);
  }
  void set(Drive drive) {
    if (chip_ == nullptr) return;
    const bool forward = (drive.direction == Direction::forward) != inverted_;
    if (two_pwm_) {
      chip_->set_duty(first_, forward ? drive.pwm : std::uint16_t{0});
      chip_->set_duty(second_, forward ? std::uint16_t{0} : drive.pwm);
    } else {
      chip_->set_duty(first_, drive.pwm);
      chip_->set_level(second_, forward);
    }
  }

 private:
  Pca9685* chip_ = nullptr;
  std::uint8_t first_ = 0;
  std::uint8_t second_ = 0;
  bool two_pwm_ = false;
  bool inverted_ = false;
};

}  // namespace firmware
}  // namespace r4
