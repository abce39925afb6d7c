// SPDX-License-Identifier: GPL-3.0-or-later
// r4::ServoCalibration: how the pulse of a servo maps to its angle.
//
//     const r4::ServoCalibration arm({r4::Microseconds(1000), r4::Degrees(-45)},
//                                    {r4::Microseconds(2000), r4::Degrees(45)});
//     board.servo(3).calibrate(arm);
//     board.servo(3).set(r4::Degrees(30));                           // S:1833,3
//     r4::Command::servo(3, arm.pulse(r4::Degrees(30)));             // the same, in a group
//     const auto angle = arm.degrees(board.state().servo_us(3));     // none while the servo is off
//
// A calibration belongs to the program. It is not sent to the board, which knows pulses only.
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

// A straight line between the two ends of the servo's travel.
class R4LINK_API ServoCalibration {
 public:
  struct End {
    Microseconds pulse;  // 1-2500
    Degrees angle;
  };
  // The ends in either order; the longer pulse may be the smaller angle. Throws Error{usage} for a
  // pulse out of range, and unless both the pulses and the angles differ.
  ServoCalibration(End one, End other);

  // True if the nearest whole microsecond is not beyond an end.
  bool is_in_range(Degrees angle) const;
  // The nearest whole microsecond. Throws Error{usage} for an angle out of range.
  Microseconds pulse(Degrees angle) const;
  // The angle of a pulse, also of a pulse beyond an end. None for 0: the servo is off.
  std::optional<Degrees> degrees(int pulse_us) const;

  const End& one() const { return one_; }
  const End& other() const { return other_; }

 private:
  double nearest_us(Degrees angle) const;

  End one_;
  End other_;
};

}  // namespace r4
