// SPDX-License-Identifier: GPL-3.0-or-later
// The chips of the R4 board on their bus, and what their pins do.
#pragma once

#include <cstdint>

#include "../../../board_channels.hpp"
#include "../../../board_hardware.hpp"
#include "../chips/i2c_bus_model.hpp"
#include "../chips/mcp23017_model.hpp"
#include "../chips/mcp4728_model.hpp"
#include "../chips/pca9685_model.hpp"

namespace r4 {
namespace sim {

// What the outputs of the chips do, in the units of the commands.
struct ChipPins {
  Drive osmc[osmc_channels];
  Drive dhb12[dhb12_channels];
  std::uint16_t servo_us[servo_channels] = {};  // to the nearest; a chip counts in 4.88 us
  std::uint8_t relays = 0;                      // bit n-1: relay n
  Bldc bldc[bldc_channels];

  // Nothing is driven, and every brake is on.
  static ChipPins safe();
  bool is_safe() const;
};
bool operator==(const ChipPins& a, const ChipPins& b);
inline bool operator!=(const ChipPins& a, const ChipPins& b) { return !(a == b); }

struct BoardChips {
  BoardChips();
  BoardChips(const BoardChips&) = delete;
  BoardChips& operator=(const BoardChips&) = delete;

  // The supply comes, or comes back.
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
