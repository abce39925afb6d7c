// SPDX-License-Identifier: GPL-3.0-or-later
// Single pins of the STM32H747's ports (RM0399, chapter GPIO). Reads and writes are one access,
// safe in any interrupt and fault handler. The set-up changes shared registers with interrupts off.
#pragma once

#include <cstdint>

#include "../../../drivers/pins.hpp"
#include "chip.hpp"
#include "interrupt_lock.hpp"

namespace r4 {
namespace giga {

struct Pin {  // as in the data sheet: PJ8 is {'J', 8}
  char port;
  std::uint8_t number;
};
constexpr bool operator==(Pin a, Pin b) { return a.port == b.port && a.number == b.number; }

struct Line {
  GPIO_TypeDef* port;
  std::uint8_t number;
};

enum class LineMode : std::uint32_t { input = 0, output = 1, alternate = 2, analog = 3 };
enum class LinePull : std::uint32_t { none = 0, up = 1, down = 2 };

// Switches on the clock of all ports. Call first.
void start_ports();
Line line_of(Pin pin);
// A line without a pin: writes have no effect, and the line reads low.
Line unconnected_line();

inline void write(Line line, bool high) {
  line.port->BSRR = std::uint32_t{1} << (high ? line.number : line.number + 16);
}
inline bool read(Line line) { return (line.port->IDR >> line.number & 1U) != 0; }

void set_mode(Line line, LineMode mode);
// An output that drives `high` from its first moment.
void make_output(Line line, bool high);
void make_input(Line line, LinePull pull);
// Open drain, released, with alternate function `function`. Does not change the mode.
void prepare_open_drain(Line line, std::uint32_t function);
void make_alternate(Line line, std::uint32_t function, LinePull pull);  // push-pull

class GpioOutput final : public firmware::OutputPin {
 public:
  explicit GpioOutput(Line line) : line_(line) { make_output(line, false); }
  void write(bool high) override { giga::write(line_, high); }

 private:
  Line line_;
};

class GpioInput final : public firmware::InputPin {
 public:
  GpioInput(Line line, LinePull pull) : line_(line) { make_input(line, pull); }
  bool read() override { return giga::read(line_); }

 private:
  Line line_;
};

}  // namespace giga
}  // namespace r4
