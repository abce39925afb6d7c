// SPDX-License-Identifier: GPL-3.0-or-later
// How a board is shown to ROS.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <vector>

#include "r4link/devices/device.hpp"
#include "r4link/state.hpp"
#include "setpoint_units.hpp"

namespace r4::tool::ros2 {

// As rcl_interfaces/Log has them.
enum class LogLevel : std::uint8_t { info = 20, warning = 30, error = 40 };

struct NodeOptions {
  FieldSet fields;  // those that the board is asked for
  ServoUnit servo;
  std::optional<double> counts_per_turn;     // of the encoders' joints; none: they are no joints
  std::optional<double> steps_per_turn;      // of the steppers'
  std::optional<DifferentialDrive> drive;    // none: there is no cmd_vel
  std::chrono::milliseconds deadline{1000};  // of a publisher that drives
  std::vector<Device> devices;               // on the user's I2C bus
  bool arm = false;                          // as soon as the board is there, once
  bool one_clock = false;  // all publishers are on this computer, so their stamps are of its clock
};

}  // namespace r4::tool::ros2
