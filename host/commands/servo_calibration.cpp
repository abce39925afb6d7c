// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/commands/servo_calibration.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace r4 {

ServoCalibration::ServoCalibration(End one, End other) : one_(one), other_(other) {
  const char* const thing = "a servo's calibration";
  for (const End& end : {one, other}) {
    if (end.pulse.value >= 1 && end.pulse.value <= servo_max_us) continue;
    throw Error(ErrorKind::usage, thing,
                fmt::format("a pulse of {} us is out of range", end.pulse.value),
                fmt::format("give 1 to {}", servo_max_us));
  }
  const double turn = other.angle.value - one.angle.value;
  const bool differ = turn != 0 && std::isfinite(turn) && one.pulse.value != other.pulse.value;
  if (differ) return;
  throw Error(ErrorKind::usage, thing, "the two ends have the same pulse or the same angle",
              "give the pulse and the angle at each end of the servo's travel");
}

double ServoCalibration::nearest_us(Degrees angle) const {
  const double share = (angle.value - one_.angle.value) / (other_.angle.value - one_.angle.value);
  return std::round(one_.pulse.value + share * (other_.pulse.value - one_.pulse.value));
}

bool ServoCalibration::is_in_range(Degrees angle) const {
  const double us = nearest_us(angle);
  const auto [shortest, longest] = std::minmax(one_.pulse.value, other_.pulse.value);
  return us >= shortest && us <= longest;
}

Microseconds ServoCalibration::pulse(Degrees angle) const {
  if (is_in_range(angle)) return Microseconds(static_cast<std::int32_t>(nearest_us(angle)));
  const auto [least, most] = std::minmax(one_.angle.value, other_.angle.value);
  throw Error(ErrorKind::usage, fmt::format("{} degrees", angle.value),
              "the angle is outside the servo's calibration",
              fmt::format("give {} to {}", least, most));
}

std::optional<Degrees> ServoCalibration::degrees(int pulse_us) const {
  if (pulse_us == 0) return std::nullopt;
  const double share =
      (static_cast<double>(pulse_us) - one_.pulse.value) / (other_.pulse.value - one_.pulse.value);
  return Degrees(one_.angle.value + share * (other_.angle.value - one_.angle.value));
}

}  // namespace r4
