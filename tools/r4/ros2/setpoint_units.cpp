// SPDX-License-Identifier: GPL-3.0-or-later
#include "setpoint_units.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "r4link/error.hpp"

namespace r4::tool::ros2 {
namespace {

constexpr double degrees_a_radian = 180 / std::numbers::pi;

template <class Number>
bool read(std::string_view text, Number& out) {
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, out);
  return error == std::errc() && rest == end;
}

std::vector<std::string_view> split(std::string_view text) {
  std::vector<std::string_view> parts;
  for (;;) {
    const std::size_t comma = text.find(',');
    parts.push_back(text.substr(0, comma));
    if (comma == std::string_view::npos) return parts;
    text.remove_prefix(comma + 1);
  }
}

std::optional<MotorChannel> motor_channel(std::string_view text) {
  MotorChannel motor;
  motor.reversed = text.starts_with('-');
  if (motor.reversed) text.remove_prefix(1);
  if (text.starts_with("osmc")) {
    text.remove_prefix(4);
  } else if (text.starts_with("dhb12_")) {
    motor.kind = CommandKind::dhb12;
    text.remove_prefix(6);
  } else {
    return std::nullopt;
  }
  if (!read(text, motor.channel) || motor.channel < 1 || motor.channel > osmc_channels) {
    return std::nullopt;
  }
  return motor;
}

}  // namespace

double to_duty(int pwm, Direction direction) {
  const double duty = static_cast<double>(pwm) / pwm_max;
  return direction == Direction::forward || pwm == 0 ? duty : -duty;
}

ServoUnit servo_unit(std::string_view text) {
  if (text == "us") return std::nullopt;
  int min_us = 0;
  int max_us = 0;
  double angle = 0;
  const auto parts = split(text);
  const bool valid = parts.size() == 3 && read(parts[0], min_us) && read(parts[1], max_us) &&
                     read(parts[2], angle) && min_us > 0 && max_us > min_us &&
                     max_us <= servo_max_us && angle > 0 && angle < 100;
  if (!valid) {
    throw Error(ErrorKind::usage, "--servo " + std::string(text), "is not a valid calibration",
                "write us, or two pulse widths and the angle between them in radians, such as "
                "500,2500,3.14");
  }
  const double half = angle / 2 * degrees_a_radian;
  return ServoCalibration({Microseconds(min_us), Degrees(-half)},
                          {Microseconds(max_us), Degrees(half)});
}

std::optional<Microseconds> to_pulse(const ServoUnit& unit, double value) {
  if (!unit) {
    const double us = std::round(value);
    if (!(us >= 0 && us <= servo_max_us)) return std::nullopt;  // also rejects NaN
    return Microseconds(static_cast<std::int32_t>(us));
  }
  const double degrees = value * degrees_a_radian;
  if (!std::isfinite(degrees) || !unit->is_in_range(Degrees(degrees))) return std::nullopt;
  return unit->pulse(Degrees(degrees));
}

double from_pulse(const ServoUnit& unit, int pulse_us) {
  if (!unit) return pulse_us;
  const auto angle = unit->degrees(pulse_us);
  return angle ? angle->value / degrees_a_radian : std::numeric_limits<double>::quiet_NaN();
}

std::optional<Command> MotorChannel::command(double duty) const {
  const Duty wanted(reversed ? -duty : duty);
  if (!wanted.is_in_range()) return std::nullopt;
  return kind == CommandKind::osmc ? Command::osmc(channel, wanted)
                                   : Command::dhb12(channel, wanted);
}

std::optional<Setpoints> DifferentialDrive::setpoints(double linear, double angular) const {
  double left_duty = (linear - angular * separation_m / 2) / full_speed_mps;
  double right_duty = (linear + angular * separation_m / 2) / full_speed_mps;
  if (!std::isfinite(left_duty) || !std::isfinite(right_duty)) return std::nullopt;
  const double beyond = std::max({1.0, std::abs(left_duty), std::abs(right_duty)});
  left_duty = std::clamp(left_duty / beyond, -1.0, 1.0);
  right_duty = std::clamp(right_duty / beyond, -1.0, 1.0);
  const auto one = left.command(left_duty);
  const auto other = right.command(right_duty);
  if (!one || !other) return std::nullopt;
  return Setpoints{*one, *other};
}

DifferentialDrive differential_drive(std::string_view channels, double separation_m,
                                     double full_speed_mps) {
  const auto parts = split(channels);
  const auto left = parts.size() == 2 ? motor_channel(parts[0]) : std::nullopt;
  const auto right = parts.size() == 2 ? motor_channel(parts[1]) : std::nullopt;
  const bool same = left && right && left->kind == right->kind && left->channel == right->channel;
  if (!left || !right || same) {
    throw Error(ErrorKind::usage, "--drive " + std::string(channels),
                "does not name two motor channels",
                "name the left and the right channel, such as osmc1,-osmc2 or dhb12_1,dhb12_2; "
                "write - for a motor that is mounted in reverse");
  }
  return {*left, *right, separation_m, full_speed_mps};
}

std::int64_t Position::advance(std::int32_t count, std::uint32_t boot) {
  if (!count_) {
    position_ = count;
  } else if (boot == boot_) {
    position_ += static_cast<std::int32_t>(static_cast<std::uint32_t>(count) -
                                           static_cast<std::uint32_t>(*count_));
  }
  count_ = count;
  boot_ = boot;
  return position_;
}

std::optional<WallTime> stamp_time(std::int32_t seconds, std::uint32_t nanoseconds) {
  if (seconds == 0 && nanoseconds == 0) return std::nullopt;
  const auto since = std::chrono::seconds(seconds) + std::chrono::nanoseconds(nanoseconds);
  return WallTime(std::chrono::duration_cast<WallTime::duration>(since));
}

bool is_outdated(const std::optional<WallTime>& stamp, WallTime now,
                 std::chrono::milliseconds deadline) {
  return stamp && deadline.count() != 0 && now - *stamp > deadline;
}

double positive_number(std::string_view name, std::string_view text) {
  double number = 0;
  if (read(text, number) && std::isfinite(number) && number > 0) return number;
  throw Error(ErrorKind::usage, std::string(name) + " " + std::string(text),
              "is not a number greater than 0", "write a number such as 0.42");
}

}  // namespace r4::tool::ros2
