// SPDX-License-Identifier: GPL-3.0-or-later
// The board's hardware, as it is wired: chips, pins, converters, and the interrupts that read them.
#pragma once

#include <cstdint>

#include "../../application/application.hpp"
#include "../../board_hardware.hpp"
#include "../../bus_choice.hpp"
#include "../../guard.hpp"
#include "analog_inputs.hpp"
#include "buses.hpp"
#include "chip/i2c_controller.hpp"
#include "chip/timers.hpp"
#include "devices/dac_output.hpp"
#include "devices/user_i2c_controller.hpp"
#include "devices/user_uart_controller.hpp"
#include "late.hpp"
#include "pins.hpp"

namespace r4 {
namespace giga {

class Machine final : public StepTick {
 public:
  // After construction every output is off. `wiring` must be without a fault of check().
  Machine(const Wiring& wiring, ChipTrouble wiring_trouble, Buses& buses);
  // Starts the edge interrupts and the step timer, which becomes a duty of the guard.
  void start(firmware::Guard& guard);
  void poll();

  firmware::BoardHardware& hardware() { return hardware_; }
  I2cController& bus() { return bus_; }
  void add_devices(firmware::Application::Config& config);

  void step_tick() override;

 private:
  struct Encoder {
    Line a, b, index;
    Late<mbed::InterruptIn> a_edge, b_edge;
    firmware::QuadratureEncoder* counter = nullptr;
    void connect(const Wiring& wiring, int channel);
    void start(firmware::QuadratureEncoder& with);
    void on_edge();
  };
  struct Echo {
    Line line;
    Late<mbed::InterruptIn> edge;
    firmware::UltrasonicSensors* sensors = nullptr;
    int sensor = 0;
    void connect(Place place);
    void start(firmware::UltrasonicSensors& with, int number);
    void on_edge();
  };
  // As long as the loop's limit, so that the core may keep interrupts off for a moment.
  static constexpr std::uint32_t step_limit_ms = 20;

  firmware::BoardPins pins();

  // In the order of power-up: pins at rest, chips' outputs off; then everything that takes longer.
  const firmware::BusChoice choice_;
  I2cController& bus_;
  GpioOutput step_[stepper_channels];
  GpioOutput direction_[stepper_channels];
  GpioOutput trigger_[ultrasonic_channels];
  GpioInput handle_;
  GpioInput gpio_[gpio_channels];
  DacOutput dac_[dac_channels];
  AnalogValue analog_values_[analog_channels];
  firmware::BoardHardware hardware_;
  struct OutputsOff {
    explicit OutputsOff(firmware::BoardHardware& hardware);
  } outputs_off_;
  AnalogInputs analog_;
  UserI2cController user_bus_;
  firmware::UserI2c user_i2c_;
  UserUartController uart1_, uart2_;
  firmware::UserUart uarts_[uart_channels];
  firmware::Guard* guard_ = nullptr;
  firmware::Guard::Duty step_duty_ = 0;
  Encoder encoders_[encoder_channels];
  Echo echoes_[ultrasonic_channels];
};

}  // namespace giga
}  // namespace r4
