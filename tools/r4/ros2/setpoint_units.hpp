// SPDX-License-Identifier: GPL-3.0-or-later
// What the typed topics of ROS mean in the board's commands, and the other way round. Values that are out of range
// or no number are no commands: nothing is rounded into range but the two wheels of a cmd_vel, which keep their
// ratio.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "r4link/command.hpp"
#include "r4link/setpoints.hpp"
#include "r4link/vocabulary.hpp"

namespace r4::tool::ros2 {

// A duty from -1, full speed backwards, to 1.
struct SignedDuty {
  int pwm = 0;
  Direction direction = Direction::forward;
};
std::optional<SignedDuty> from_duty(double duty);
double to_duty(int pwm, Direction direction);

// Radians of a servo: from min_us to max_us it turns by `angle`; 0 is in the middle.
struct ServoCalibration {
  bool microseconds = false;  // its topics carry the pulse width instead
  int min_us = 500;
  int max_us = 2500;
  double angle = 3.14159265358979;
};
// "us", or "500,2500,3.14". Throws Error{usage}.
ServoCalibration servo_calibration(std::string_view text);
std::optional<int> to_pulse(const ServoCalibration& servo, double value);
// NaN for a servo that is off.
double from_pulse(const ServoCalibration& servo, int pulse_us);

// A motor channel, and whether it is mounted the other way round: "osmc1", "-dhb12_3".
struct MotorChannel {
  CommandKind kind = CommandKind::osmc;
  int channel = 1;
  bool reversed = false;
  std::optional<Command> command(double duty) const;
};

// A robot with a wheel on either side, for cmd_vel.
struct DifferentialDrive {
  MotorChannel left;
  MotorChannel right;
  double separation_m = 0;    // between the wheels
  double full_speed_mps = 0;  // of a wheel at duty 1
  // None where it is no number. `linear` m/s ahead, `angular` rad/s to the left.
  std::optional<Setpoints> setpoints(double linear, double angular) const;
};
// "osmc1,-osmc2" and the two lengths. Throws Error{usage}.
DifferentialDrive differential_drive(std::string_view channels, double separation_m,
                                     double full_speed_mps);

// A number greater than 0, as `name` takes it. Throws Error{usage}.
double positive_number(std::string_view name, std::string_view text);

}  // namespace r4::tool::ros2
