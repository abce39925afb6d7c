// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "../../../board_hardware.hpp"
#include "../chips/i2c_bus_model.hpp"
#include "../chips/mcp23017_model.hpp"
#include "../chips/mcp4728_model.hpp"
#include "../chips/pca9685_model.hpp"
#include "r4link/simulation/simulated_pins.hpp"
#include "r4link/wiring/wiring.hpp"

namespace r4 {
namespace sim {

struct BoardChips {
  explicit BoardChips(const Wiring& wired = plan_wiring());
  BoardChips(const BoardChips&) = delete;
  BoardChips& operator=(const BoardChips&) = delete;

  void power_on();
  // A brake without a line is on while its motor is stopped.
  ChipPins pins() const;
  // Channels are numbered from 1.
  Drive osmc_drive(int channel) const;
  Drive dhb12_drive(int channel) const;
  bool relay_closed(int channel) const;
  I2cChipModel& operator[](Chip chip);

  const Wiring wiring;
  I2cBusModel bus;
  Mcp23017Model expander;
  Pca9685Model osmc;
  Pca9685Model dhb12;
  Pca9685Model servo;
  Mcp4728Model dac;

 private:
  Drive drive(SignalKind pwm, SignalKind direction, int channel) const;
  bool is_driven(SignalKind kind, int channel) const;
};

}  // namespace sim
}  // namespace r4
