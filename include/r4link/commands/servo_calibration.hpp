// SPDX-License-Identifier: GPL-3.0-or-later
// r4::ServoCalibration: how the pulse of a servo maps to its angle.
//     const r4::ServoCalibration arm({r4::Microseconds(1000), r4::Degrees(-45)},
//                                    {r4::Microseconds(2000), r4::Degrees(45)});
//     board.servo(3).calibrate(arm);
//     board.servo(3).set(r4::Degrees(30));                           // S:1833,3
//     r4::Command::servo(3, arm.pulse(r4::Degrees(30)));             // the same, in a group
//     const auto angle = arm.degrees(board.state().servo_us(3));     // empty if the servo is off
//
// The calibration is not sent to the board, whose commands have only pulses.
#pragma once

#include <limits>
#include <optional>
#include <type_traits>

#include "../command.hpp"
#include "../config.hpp"
#include "../error.hpp"

namespace r4 {

// An angle. Throws Error{usage} for NaN and infinity.
struct Degrees {
  template <class Number,
            class = std::enable_if_t<std::is_arithmetic_v<Number> && !std::is_same_v<Number, bool>>>
  constexpr explicit Degrees(Number degrees) : value(finite(static_cast<double>(degrees))) {}
  double value;

 private:
  static constexpr double finite(double degrees) {
    constexpr double most = std::numeric_limits<double>::max();
    if (degrees >= -most && degrees <= most) return degrees;
    throw Error(ErrorKind::usage, "an angle", "it is not a finite number", "give degrees");
  }
};

// Linear between the two ends of the servo's travel.
class R4LINK_API ServoCalibration {
 public:
  struct End {
    Microseconds pulse;  // 1-2500
    Degrees angle;
  };
  // The ends may be in either order, and the longer pulse may have the smaller angle. Throws
  // Error{usage} for a pulse out of range, and for equal pulses or equal angles.
  ServoCalibration(End one, End other);

  // True if the nearest whole microsecond is between the ends.
  bool is_in_range(Degrees angle) const;
  // Rounded to the nearest whole microsecond. Throws Error{usage} for an angle out of range.
  Microseconds pulse(Degrees angle) const;
  // The angle of a pulse, also beyond the ends. Empty for 0, because the servo is off.
  std::optional<Degrees> degrees(int pulse_us) const;

  const End& one() const { return one_; }
  const End& other() const { return other_; }

 private:
  double nearest_us(Degrees angle) const;

  End one_;
  End other_;
};

}  // namespace r4
