// SPDX-License-Identifier: GPL-3.0-or-later
// Models of pins that keep their level, and a bench with the whole board: chips on a bus, pins, the
// hardware.
#pragma once

#include <array>
#include <cstdint>

#include "bus_log.hpp"
#include "firmware/board_hardware.hpp"
#include "firmware/drivers/pins.hpp"
#include "firmware/ports/sim/robot/board_chips.hpp"

namespace r4::test {

struct OutputPinModel final : firmware::OutputPin {
  void write(bool to) override {
    if (to && !high) ++rises;
    high = to;
  }
  bool high = false;
  int rises = 0;
};

struct InputPinModel final : firmware::InputPin {
  bool read() override { return high; }
  bool high = false;
};

struct AnalogPinModel final : firmware::AnalogPin {
  std::uint16_t read() override { return counts; }
  std::uint16_t counts = 0;
};

struct AnalogOutputPinModel final : firmware::AnalogOutputPin {
  void write(std::uint16_t wanted) override { millivolts = wanted; }
  std::uint16_t millivolts = 0;
};

// A provisioned EEPROM keeps the set-up short.
struct BoardParts : sim::BoardChips {
  BoardParts() {
    for (int i = 0; i < sim::Mcp4728Model::channels; ++i) dac.set_eeprom(i, {});
    power_on();
  }
  firmware::BoardPins microcontroller_pins() {
    firmware::BoardPins all{};
    for (std::size_t i = 0; i < 4; ++i) {
      all.step[i] = &step[i];
      all.direction[i] = &direction[i];
      all.trigger[i] = &trigger[i];
    }
    for (std::size_t i = 0; i < analog.size(); ++i) all.analog[i] = &analog[i];
    all.handle = &handle;
    for (std::size_t i = 0; i < analog_output.size(); ++i) all.dac[i] = &analog_output[i];
    for (std::size_t i = 0; i < gpio.size(); ++i) all.gpio[i] = &gpio[i];
    return all;
  }
  std::array<OutputPinModel, 4> step;
  std::array<OutputPinModel, 4> direction;
  std::array<OutputPinModel, 4> trigger;
  std::array<AnalogPinModel, analog_channels> analog;
  InputPinModel handle;
  std::array<AnalogOutputPinModel, dac_channels> analog_output;
  std::array<InputPinModel, gpio_channels> gpio;
};

// The outputs that the chips' pins show, without the steppers.
firmware::Outputs outputs_of(const BoardParts& board);
// `outputs` as the pins can show them: without steppers, and with servo pulses rounded to the
// nearest count.
firmware::Outputs as_pins(firmware::Outputs outputs);

}  // namespace r4::test
