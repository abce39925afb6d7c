// SPDX-License-Identifier: GPL-3.0-or-later
// The pins of a simulated board, independent of its state, and a robot model of your own.
#pragma once

#include <cstdint>

#include "../config.hpp"
#include "../state.hpp"
#include "../vocabulary.hpp"

namespace r4 {
namespace sim {

// The outputs of the chips, in the units of the commands.
struct R4LINK_API ChipPins {
  Drive osmc[osmc_channels];
  Drive dhb12[dhb12_channels];
  std::uint16_t servo_us[servo_channels] = {};  // rounded; a chip's step is 4.88 us
  std::uint8_t relays = 0;                      // bit n-1: relay n
  Bldc bldc[bldc_channels];

  // Every output is off, and every brake is on.
  static ChipPins safe();
  bool is_safe() const;
};
R4LINK_API bool operator==(const ChipPins& a, const ChipPins& b);
inline bool operator!=(const ChipPins& a, const ChipPins& b) { return !(a == b); }

struct R4LINK_API Pins : ChipPins {
  struct Stepper {
    std::int32_t position = 0;  // pulses since power-on, forward minus backward
    std::int8_t stepping = 0;   // 1 forward, -1 backward, 0: no pulse for stepper_pause_ms
  };
  Stepper stepper[stepper_channels];

  bool is_safe() const;
};
// True if the outputs are equal; the steppers' positions are not compared.
R4LINK_API bool operator==(const Pins& a, const Pins& b);
inline bool operator!=(const Pins& a, const Pins& b) { return !(a == b); }

// The motors and sensors of a robot in place of the bench vehicle (docs/how-to/simulation.md).
class R4LINK_API RobotModel {
 public:
  struct Senses {
    // Counts by which encoder n turned in this millisecond; reset to 0 before each call.
    std::int32_t encoder_turned[encoder_channels] = {};
    // Hundredths of a volt, kept between calls. `as_on_the_bench`: the bench sets the voltage.
    static constexpr std::int32_t as_on_the_bench = -1;
    std::int32_t analog_cv[analog_channels] = {as_on_the_bench, as_on_the_bench, as_on_the_bench,
                                               as_on_the_bench, as_on_the_bench, as_on_the_bench};
    // Kept between calls. 0: no echo.
    std::uint16_t ultrasonic_cm[ultrasonic_channels] = {};
  };
  // Called for each millisecond. Without supply no motor turns, even if the pins drive it.
  virtual void pass_millisecond(const ChipPins& pins, bool motors_have_supply, Senses& senses) = 0;

 protected:
  ~RobotModel() = default;
};

}  // namespace sim
}  // namespace r4
