// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "../../../drivers/pins.hpp"

namespace r4 {
namespace sim {

class OutputPinModel final : public firmware::OutputPin {
 public:
  void write(bool high) override {
    if (high && !high_) ++rises_;
    high_ = high;
  }
  bool high() const { return high_; }
  std::uint32_t rises() const { return rises_; }

 private:
  bool high_ = false;
  std::uint32_t rises_ = 0;
};

class InputPinModel final : public firmware::InputPin {
 public:
  bool read() override { return high_; }
  void set(bool high) { high_ = high; }

 private:
  bool high_ = false;
};

class AnalogOutputPinModel final : public firmware::AnalogOutputPin {
 public:
  void write(std::uint16_t millivolts) override { millivolts_ = millivolts; }
  std::uint16_t millivolts() const { return millivolts_; }

 private:
  std::uint16_t millivolts_ = 0;
};

class StepperDriverModel {
 public:
  StepperDriverModel() { step_.driver = this; }
  StepperDriverModel(const StepperDriverModel&) = delete;
  StepperDriverModel& operator=(const StepperDriverModel&) = delete;

  firmware::OutputPin& step() { return step_; }
  firmware::OutputPin& direction() { return direction_; }
  void set_forward_level(bool high) { forward_level_ = high; }
  bool forward() const { return direction_.high() == forward_level_; }

  void power_on() { position_ = shaft_ = 0; }
  void supply_motor(bool supplied) { supplied_ = supplied; }
  // Commanded steps since power_on(), forward minus backward; wraps at 32 bits.
  std::int32_t position() const { return static_cast<std::int32_t>(position_); }
  std::int32_t shaft() const { return static_cast<std::int32_t>(shaft_); }
  std::uint32_t pulses() const { return step_.pin.rises(); }

 private:
  struct StepPin final : firmware::OutputPin {
    void write(bool high) override {
      const std::uint32_t before = pin.rises();
      pin.write(high);
      if (pin.rises() != before) driver->step_once();
    }
    OutputPinModel pin;
    StepperDriverModel* driver = nullptr;
  };

  void step_once() {
    const std::uint32_t step = forward() ? 1U : ~0U;
    position_ += step;
    if (supplied_) shaft_ += step;
  }

  StepPin step_;
  OutputPinModel direction_;
  bool forward_level_ = true;
  std::uint32_t position_ = 0;
  std::uint32_t shaft_ = 0;
  bool supplied_ = false;
};

}  // namespace sim
}  // namespace r4
