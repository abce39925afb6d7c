// SPDX-License-Identifier: GPL-3.0-or-later
// What the typed topics of ROS mean in the board's commands, and the other way round. Values that are out of range
// or no number are no commands: nothing is rounded into range but the two wheels of a cmd_vel, which keep their
// ratio.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "r4link/command.hpp"
#include "r4link/commands/servo_calibration.hpp"
#include "r4link/setpoints.hpp"
#include "r4link/vocabulary.hpp"

namespace r4::tool::ros2 {

// From -1 (full reverse) to 1.
double to_duty(int pwm, Direction direction);

// What the topics of servos carry: radians by a calibration; none: pulses in microseconds.
using ServoUnit = std::optional<ServoCalibration>;
// "us", or two pulses and the angle between them, with 0 in the middle: "500,2500,3.14". Throws
// Error{usage}.
ServoUnit servo_unit(std::string_view text);
std::optional<Microseconds> to_pulse(const ServoUnit& unit, double value);
// NaN for a servo that is off, in radians.
double from_pulse(const ServoUnit& unit, int pulse_us);

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

// A counter of the board as a position without jumps. The counter has 32 bits and wraps, and begins
// at 0 when the board restarts: the position goes on from where it was. What was counted before the
// first state after a restart is lost.
class Position {
 public:
  // `boot` differs from that of the state before if the board has restarted in between.
  std::int64_t advance(std::int32_t count, std::uint32_t boot);

 private:
  std::int64_t position_ = 0;
  std::optional<std::int32_t> count_;
  std::uint32_t boot_ = 0;
};

using WallTime = std::chrono::system_clock::time_point;
// The stamp of a header; none for 0, which says nothing.
std::optional<WallTime> stamp_time(std::int32_t seconds, std::uint32_t nanoseconds);
// True if a command with that stamp is older than `deadline`; 0: there is none. Both clocks are the
// same.
bool is_outdated(const std::optional<WallTime>& stamp, WallTime now,
                 std::chrono::milliseconds deadline);

// A number greater than 0, as `name` takes it. Throws Error{usage}.
double positive_number(std::string_view name, std::string_view text);

}  // namespace r4::tool::ros2
