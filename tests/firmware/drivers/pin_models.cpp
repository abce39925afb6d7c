// SPDX-License-Identifier: GPL-3.0-or-later
#include "pin_models.hpp"

#include <algorithm>
#include <iterator>

namespace r4::test {

using namespace firmware;

Outputs outputs_of(const BoardParts& board) {
  const sim::ChipPins pins = board.pins();
  Outputs outputs;
  std::copy(std::begin(pins.osmc), std::end(pins.osmc), outputs.osmc);
  std::copy(std::begin(pins.dhb12), std::end(pins.dhb12), outputs.dhb12);
  std::copy(std::begin(pins.servo_us), std::end(pins.servo_us), outputs.servo_us);
  std::copy(std::begin(pins.bldc), std::end(pins.bldc), outputs.bldc);
  outputs.relays = pins.relays;
  return outputs;
}

Outputs as_pins(Outputs outputs) {
  for (StepperTarget& target : outputs.stepper) target = {};
  for (std::uint16_t& us : outputs.servo_us) {
    const int counts = (us * 25 + 61) / 122;  // one count is 4.88 us
    us = static_cast<std::uint16_t>((counts * 122 + 12) / 25);
  }
  return outputs;
}

}  // namespace r4::test
