// SPDX-License-Identifier: GPL-3.0-or-later
// The two I2C buses of the Giga, of which one has the board's chips: 0 is SDA and SCL (D20, D21), 1
// is SDA1 and SCL1. Before the wiring is known, the board reads from the address that all PCA9685
// share, on both buses. If a PCA9685 answers, every PWM output on its bus is switched off.
#pragma once

#include <cstdint>

#include "chip/i2c_controller.hpp"

namespace r4 {
namespace giga {

constexpr int bus_count = 2;

I2cController::Parts parts_of_bus(int bus);
// Switches the clock of the bus's peripheral on. Returns its frequency in Hz.
std::uint32_t start_bus_clock(int bus);

class Buses {
 public:
  // Switches all ports on, and the user's voltages to 0 V.
  Buses();
  I2cController& operator[](int bus) { return bus == 0 ? first_ : second_; }
  // Bit n: a PCA9685 answered on bus n.
  unsigned answers() const { return answers_; }

 private:
  struct PortsOn {
    PortsOn();
  };
  PortsOn ports_on_;  // must be first
  I2cController first_;
  I2cController second_;
  unsigned answers_ = 0;
};

}  // namespace giga
}  // namespace r4
