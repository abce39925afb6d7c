// SPDX-License-Identifier: GPL-3.0-or-later
// The six analog inputs: one conversion a poll, in turn, so that nobody waits for six; each is read
// from its newest. From the loop only.
#pragma once

#include <cstdint>

#include "chip.hpp"
#include "pins.hpp"

namespace r4 {
namespace giga {

constexpr PinName pin_name(Pin pin) {
  return static_cast<PinName>((pin.port - 'A') << 4 | pin.number);
}
static_assert(pin_name({'A', 0}) == PA_0 && pin_name({'C', 5}) == PC_5 &&
                  pin_name({'K', 7}) == PK_7,
              "the core numbers its pins otherwise");

// What a driver reads: the newest conversion of one input.
class AnalogValue final : public firmware::AnalogPin {
 public:
  std::uint16_t read() override { return newest; }
  std::uint16_t newest = 0;
};

class AnalogInputs {
 public:
  explicit AnalogInputs(AnalogValue (&values)[analog_channels]) : values_(values) {
    for (int i = 0; i < analog_channels; ++i) poll();
  }

  // A conversion of the next input: some ten microseconds.
  void poll() {
    values_[next_].newest = converters_[next_].read_u16();
    next_ = (next_ + 1) % analog_channels;
  }

 private:
  AnalogValue (&values_)[analog_channels];
  static_assert(analog_channels == 6, "as below");
  mbed::AnalogIn converters_[analog_channels] = {
      {pin_name(analog_pins[0])}, {pin_name(analog_pins[1])}, {pin_name(analog_pins[2])},
      {pin_name(analog_pins[3])}, {pin_name(analog_pins[4])}, {pin_name(analog_pins[5])}};
  int next_ = 0;
};

}  // namespace giga
}  // namespace r4
