// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <vector>

#include "r4link/devices/device.hpp"
#include "r4link/state.hpp"
#include "setpoint_units.hpp"

namespace r4::tool::ros2 {

enum class LogLevel : std::uint8_t { info = 20, warning = 30, error = 40 };

struct NodeOptions {
  FieldSet fields;  // requested from the board
  ServoUnit servo;
  std::optional<double> counts_per_turn;     // for encoder joints; none: no joints
  std::optional<double> steps_per_turn;      // for stepper joints
  std::optional<DifferentialDrive> drive;    // none: no cmd_vel
  std::chrono::milliseconds deadline{1000};  // longest silence of a publisher that drives
  std::vector<Device> devices;
  bool arm = false;        // arms once, when the board is connected
  bool one_clock = false;  // all publishers are on this computer, so stamps use its clock
};

}  // namespace r4::tool::ros2
