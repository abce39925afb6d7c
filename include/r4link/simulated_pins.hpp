// SPDX-License-Identifier: GPL-3.0-or-later
// What the pins of a simulated board do, whatever its state says, and a robot of the program's own behind them.
#pragma once

#include <cstdint>

#include "config.hpp"
#include "state.hpp"
#include "vocabulary.hpp"

namespace r4 {
namespace sim {

// What the outputs of the chips do, in the units of the commands.
struct R4LINK_API ChipPins {
  Drive osmc[osmc_channels];
  Drive dhb12[dhb12_channels];
  std::uint16_t servo_us[servo_channels] = {};  // to the nearest; a chip counts in 4.88 us
  std::uint8_t relays = 0;                      // bit n-1: relay n
  Bldc bldc[bldc_channels];

  // Nothing is driven, and every brake is on.
  static ChipPins safe();
  bool is_safe() const;
};
R4LINK_API bool operator==(const ChipPins& a, const ChipPins& b);
inline bool operator!=(const ChipPins& a, const ChipPins& b) { return !(a == b); }

// What all outputs of the board do.
struct R4LINK_API Pins : ChipPins {
  struct Stepper {
    std::int32_t position = 0;  // pulses since power came, forward less backward
    std::int8_t stepping = 0;   // 1 forward, -1 backward, 0: no pulse for stepper_pause_ms
  };
  Stepper stepper[stepper_channels];

  bool is_safe() const;
};
// Whether the outputs do the same; the steppers' positions do not count.
R4LINK_API bool operator==(const Pins& a, const Pins& b);
inline bool operator!=(const Pins& a, const Pins& b) { return !(a == b); }

// A robot in place of the vehicle on the bench (docs/simulation.md): what its motors do with the outputs, and what its
// sensors tell of that.
class R4LINK_API RobotModel {
 public:
  struct Senses {
    // Counts that encoder n has turned in this millisecond; begins with 0 in each.
    std::int32_t encoder_turned[encoder_channels] = {};
    // Hundredths of a volt; `as_on_the_bench` where it says nothing of an input. What is said stays.
    static constexpr std::int32_t as_on_the_bench = -1;
    std::int32_t analog_cv[analog_channels] = {as_on_the_bench, as_on_the_bench, as_on_the_bench,
                                               as_on_the_bench, as_on_the_bench, as_on_the_bench};
    // 0: nothing in sight; stays.
    std::uint16_t ultrasonic_cm[ultrasonic_channels] = {};
  };
  // A millisecond passes. Without a supply no motor is driven, whatever its driver is told.
  virtual void pass_millisecond(const ChipPins& pins, bool motors_have_supply, Senses& senses) = 0;

 protected:
  ~RobotModel() = default;
};

}  // namespace sim
}  // namespace r4
