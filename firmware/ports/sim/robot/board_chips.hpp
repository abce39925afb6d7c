// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "../../../board_channels.hpp"
#include "../../../board_hardware.hpp"
#include "../chips/i2c_bus_model.hpp"
#include "../chips/mcp23017_model.hpp"
#include "../chips/mcp4728_model.hpp"
#include "../chips/pca9685_model.hpp"
#include "r4link/simulation/simulated_pins.hpp"

namespace r4 {
namespace sim {

struct BoardChips {
  BoardChips();
  BoardChips(const BoardChips&) = delete;
  BoardChips& operator=(const BoardChips&) = delete;

  void power_on();
  ChipPins pins() const;
  // Channels count from 1.
  Drive osmc_drive(int channel) const;
  Drive dhb12_drive(int channel) const;
  bool relay_closed(int channel) const;
  I2cChipModel& operator[](firmware::Chip chip);

  I2cBusModel bus;
  Mcp23017Model expander{firmware::expander_address};
  Pca9685Model osmc{firmware::osmc_pwm_address};
  Pca9685Model dhb12{firmware::dhb12_pwm_address};
  Pca9685Model servo{firmware::servo_pwm_address};
  Mcp4728Model dac{firmware::dac_address};
};

}  // namespace sim
}  // namespace r4
