// SPDX-License-Identifier: GPL-3.0-or-later
// The simulated board's hardware: inputs that move as in the paper's capture, outputs that
// remember.
//
// By default a drivable board stands on the bench as in the capture (paper section 4.4): handle
// held, nothing in sight. Analog inputs take the values of the capture's converters as often as
// they occur there; which one depends on the seed and the time alone, so the same seed gives the
// same trace. As portable as the firmware: the image for the Cortex-M7 uses it too.
#pragma once

#include <cstdint>

#include "../../hal.hpp"

namespace r4 {
namespace sim {

class SimulatedHal final : public firmware::Hal {
 public:
  explicit SimulatedHal(std::uint64_t seed) : seed_(seed) {}

  // Power is switched on: outputs off, steppers and encoders at 0. The surroundings stay.
  void power_on(std::uint32_t now_ms);
  // Lets time pass: steppers move, analog inputs change.
  void advance(std::uint32_t now_ms);

  void apply(const firmware::Outputs& outputs) override { outputs_ = outputs; }
  void make_safe() override { outputs_ = firmware::Outputs(); }
  void sample(firmware::Inputs& inputs) override;
  void zero(int channel) override;
  bool clear_fault() override { return true; }

  // The surroundings. Channels count from 1.
  void hold_handle(bool held) { handle_held_ = held; }
  void set_ultrasonic(int channel, std::uint16_t cm) { ultrasonic_cm_[channel - 1] = cm; }
  void set_encoder(int channel, std::int32_t counts) { encoder_counts_[channel - 1] = counts; }
  // The input stays at `centivolts` (hundredths of a volt) from now on.
  void pin_analog(Analog input, std::int32_t centivolts);

  const firmware::Outputs& outputs() const { return outputs_; }  // what the hardware was told

 private:
  // A stepper's position, with the part of a step that it has gone, in thousandths.
  struct Stepper {
    std::int32_t position = 0;
    std::uint32_t thousandths = 0;
  };
  static void move(Stepper& stepper, const firmware::StepperTarget& target,
                   std::uint32_t passed_ms);
  std::int32_t analog_cv(int input) const;

  std::uint64_t seed_;
  std::uint32_t now_ms_ = 0;
  firmware::Outputs outputs_;
  Stepper steppers_[stepper_channels];
  std::int32_t encoder_counts_[encoder_channels] = {};
  std::uint16_t ultrasonic_cm_[ultrasonic_channels] = {};
  std::int32_t pinned_cv_[analog_channels] = {};
  std::uint8_t pinned_ = 0;  // bit n: analog input n stays at pinned_cv_[n]
  bool handle_held_ = true;
};

}  // namespace sim
}  // namespace r4
