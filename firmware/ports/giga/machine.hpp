// SPDX-License-Identifier: GPL-3.0-or-later
// The board's hardware: chips on the I2C bus, pins, converters, and the interrupts that read them.
#pragma once

#include <cstdint>

#include "../../application/application.hpp"
#include "../../board_hardware.hpp"
#include "../../guard.hpp"
#include "analog_inputs.hpp"
#include "chip/i2c_controller.hpp"
#include "chip/timers.hpp"
#include "devices/dac_output.hpp"
#include "devices/user_i2c_controller.hpp"
#include "devices/user_uart_controller.hpp"
#include "pins.hpp"

namespace r4 {
namespace giga {

class Machine final : public StepTick {
 public:
  // Sets up bus and pins. Every output of the board is off when it returns.
  Machine();
  // Starts the edge interrupts and the step timer, which becomes a duty of the guard.
  void start(firmware::Guard& guard);
  // One turn of the loop: at most bus_bytes_per_poll bytes on the bus, and one conversion.
  void poll();

  firmware::BoardHardware& hardware() { return hardware_; }
  I2cController& bus() { return bus_; }
  void add_devices(firmware::Application::Config& config);

  void step_tick() override;

 private:
  struct Encoder {
    Encoder(Pin a, Pin b, Pin index);
    Line a;
    Line b;
    GpioInput index;
    mbed::InterruptIn a_edge;
    mbed::InterruptIn b_edge;
    firmware::QuadratureEncoder* counter = nullptr;
    void on_edge();
  };
  struct Echo {
    explicit Echo(Pin pin);
    Line line;
    mbed::InterruptIn edge;
    firmware::UltrasonicSensors* sensors = nullptr;
    int sensor = 0;
    void on_edge();
  };
  // A 40 kHz interrupt that is later than this counts as missed. As long as the loop's limit, so
  // that the core may keep interrupts off for a moment.
  static constexpr std::uint32_t step_limit_ms = 20;

  struct PortsOn {
    PortsOn() {
      start_ports();
      start_dac(dac_pins);
    }
  };
  struct OutputsOff {
    OutputsOff(I2cController& bus, firmware::BoardHardware& hardware);
  };
  firmware::BoardPins pins();

  // Members are constructed in the order of power-up: clock of the ports, bus, pins at rest, chips'
  // outputs off; then everything that takes longer.
  PortsOn ports_on_;
  I2cController bus_;
  GpioOutput step_[stepper_channels];
  GpioOutput direction_[stepper_channels];
  GpioOutput trigger_[ultrasonic_channels];
  GpioInput handle_;
  GpioInput gpio_[gpio_channels];
  DacOutput dac_[dac_channels];
  AnalogValue analog_values_[analog_channels];
  firmware::BoardHardware hardware_;
  OutputsOff outputs_off_;
  AnalogInputs analog_;
  UserI2cController user_bus_;
  firmware::UserI2c user_i2c_;
  UserUartController uart1_, uart2_;
  firmware::UserUart uarts_[uart_channels];
  firmware::Guard* guard_ = nullptr;
  firmware::Guard::Duty step_duty_ = 0;
  // Single members, because GCC 7 and 8 copy the elements of an array that a constructor makes (GCC
  // bug 63707), and these types cannot be copied.
  Encoder encoder1_, encoder2_, encoder3_, encoder4_;
  Encoder* const encoders_[encoder_channels] = {&encoder1_, &encoder2_, &encoder3_, &encoder4_};
  Echo echo1_, echo2_, echo3_, echo4_;
  Echo* const echoes_[ultrasonic_channels] = {&echo1_, &echo2_, &echo3_, &echo4_};
};

}  // namespace giga
}  // namespace r4
