// SPDX-License-Identifier: GPL-3.0-or-later
// Values out of range and NaN are not commands. Only the wheels of cmd_vel are scaled into range.
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

// The duty from -1 (full reverse) to 1.
double to_duty(int pwm, Direction direction);

// Unit of servo topics: radians by a calibration; none: pulses in microseconds.
using ServoUnit = std::optional<ServoCalibration>;
// "us", or two pulses and the angle between them: "500,2500,3.14". Throws Error{usage}.
ServoUnit servo_unit(std::string_view text);
std::optional<Microseconds> to_pulse(const ServoUnit& unit, double value);
// The angle in radians: NaN for a disabled servo.
double from_pulse(const ServoUnit& unit, int pulse_us);

// A motor channel, possibly mounted in reverse: "osmc1", "-dhb12_3".
struct MotorChannel {
  CommandKind kind = CommandKind::osmc;
  int channel = 1;
  bool reversed = false;
  std::optional<Command> command(double duty) const;
};

struct DifferentialDrive {
  MotorChannel left;
  MotorChannel right;
  double separation_m = 0;    // between the wheels
  double full_speed_mps = 0;  // speed of a wheel at duty 1
  // Empty for NaN. `linear`: m/s ahead; `angular`: rad/s to the left.
  std::optional<Setpoints> setpoints(double linear, double angular) const;
};
// "osmc1,-osmc2" and the two lengths. Throws Error{usage}.
DifferentialDrive differential_drive(std::string_view channels, double separation_m,
                                     double full_speed_mps);

// A 32-bit counter of the board as a position without jumps. The counter wraps and restarts at 0
// with the board. Counts before the first state after a restart are lost.
class Position {
 public:
  std::int64_t advance(std::int32_t count, std::uint32_t boot);

 private:
  std::int64_t position_ = 0;
  std::optional<std::int32_t> count_;
  std::uint32_t boot_ = 0;
};

using WallTime = std::chrono::system_clock::time_point;
// The time of a header's stamp; empty for 0.
std::optional<WallTime> stamp_time(std::int32_t seconds, std::uint32_t nanoseconds);
// True if the stamp is older than `deadline`; 0: no deadline. Both times are from the same clock.
bool is_outdated(const std::optional<WallTime>& stamp, WallTime now,
                 std::chrono::milliseconds deadline);

// Parses a number greater than 0 for option `name`. Throws Error{usage}.
double positive_number(std::string_view name, std::string_view text);

}  // namespace r4::tool::ros2
