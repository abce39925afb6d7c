// SPDX-License-Identifier: GPL-3.0-or-later
// Carries out checked commands: setpoints, thresholds, field selection, settings.
#pragma once

#include <cstdint>

#include "../protocol/messages/settings.hpp"
#include "hal.hpp"
#include "r4link/command.hpp"

namespace r4 {
namespace firmware {

struct Setpoints {
  Outputs outputs;
  std::uint16_t proximity_cm[ultrasonic_channels] = {};  // 0: no threshold
  FieldSet fields = FieldSet::paper_default();
  Settings settings;
};

// Carries out `command` completely, or changes nothing and returns the reason. After
// check_command() only names of fields and settings, and channels, can be refused. Commands that
// the application handles (heartbeat, stop, X other than X:DAC …) have no effect here.
Refusal carry_out(const Command& command, Setpoints& setpoints);

}  // namespace firmware
}  // namespace r4
