// SPDX-License-Identifier: GPL-3.0-or-later
// Carries out commands that have passed every check: setpoints, thresholds, field selection,
// settings.
#pragma once

#include <cstdint>

#include "../protocol/messages/settings.hpp"
#include "hal.hpp"
#include "r4link/command.hpp"

namespace r4 {
namespace firmware {

// What commands change. The application decides whether the outputs reach the hardware.
struct Setpoints {
  Outputs outputs;
  std::uint16_t proximity_cm[ultrasonic_channels] = {};  // 0: that sensor stops nothing
  FieldSet fields = FieldSet::paper_default();
  Settings settings;
};

// Carries `command` out on `setpoints`: wholly, or not at all with the reason why. The caller
// has used check_command(), so only names of fields and settings, and channels, are refused here. Stop, clear,
// zero, heartbeat and identify change no setpoint and are left to the application.
Refusal carry_out(const Command& command, Setpoints& setpoints);

}  // namespace firmware
}  // namespace r4
