// SPDX-License-Identifier: GPL-3.0-or-later
// Single lines of the STM32H747's ports, by their registers (RM0399, chapter GPIO).
//
// Reading and writing are one access each, right in any interrupt and in a fault handler. Setting a
// line up changes registers that it shares with its neighbours: interrupts are off for that moment.
#pragma once

#include <cstdint>

#include "../../../drivers/pins.hpp"
#include "chip.hpp"
#include "interrupt_lock.hpp"

namespace r4 {
namespace giga {

// A pin as the data sheet calls it: PJ8 is {'J', 8}.
struct Pin {
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

// Switches on the clock of all ports; before anything else here.
void start_ports();
Line line_of(Pin pin);

inline void write(Line line, bool high) {
  line.port->BSRR = std::uint32_t{1} << (high ? line.number : line.number + 16);
}
inline bool read(Line line) { return (line.port->IDR >> line.number & 1U) != 0; }

void set_mode(Line line, LineMode mode);
// An output that stands at `high` from the moment on at which it drives.
void make_output(Line line, bool high);
void make_input(Line line, LinePull pull);
// Open drain, its level released, for alternate function `function`; the mode stays what it is.
void prepare_open_drain(Line line, std::uint32_t function);
// Push-pull for a peripheral.
void make_alternate(Line line, std::uint32_t function, LinePull pull);

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
