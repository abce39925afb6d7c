// SPDX-License-Identifier: GPL-3.0-or-later
#include "gpio.hpp"

namespace r4 {
namespace giga {

namespace {

constexpr std::uint32_t all_ports = 0x7FF;  // GPIOAEN … GPIOKEN of RCC_AHB4ENR

// Memory in place of the registers of a port.
GPIO_TypeDef no_port;  // NOLINT(cppcoreguidelines-avoid-non-const-global-variables)

template <class Register>
void set_field(Register& field, std::uint32_t index, std::uint32_t bits, std::uint32_t value) {
  const std::uint32_t mask = ((std::uint32_t{1} << bits) - 1) << (index * bits);
  const InterruptLock lock;
  field = (field & ~mask) | value << (index * bits);
}

void set_pull(Line line, LinePull pull) {
  set_field(line.port->PUPDR, line.number, 2, static_cast<std::uint32_t>(pull));
}

void set_function(Line line, std::uint32_t function) {
  set_field(line.port->AFR[line.number / 8], line.number % 8, 4, function);
}

}  // namespace

void start_ports() {
  const InterruptLock lock;
  RCC->AHB4ENR |= all_ports;
  static_cast<void>(static_cast<std::uint32_t>(RCC->AHB4ENR));  // waits until the clock is on
}

Line line_of(Pin pin) {
  GPIO_TypeDef* const ports[] = {GPIOA, GPIOB, GPIOC, GPIOD, GPIOE, GPIOF,
                                 GPIOG, GPIOH, GPIOI, GPIOJ, GPIOK};
  return Line{ports[pin.port - 'A'], pin.number};
}

Line unconnected_line() { return Line{&no_port, 0}; }

void set_mode(Line line, LineMode mode) {
  set_field(line.port->MODER, line.number, 2, static_cast<std::uint32_t>(mode));
}

void make_output(Line line, bool high) {
  write(line, high);
  set_field(line.port->OTYPER, line.number, 1, 0);
  set_pull(line, LinePull::none);
  set_mode(line, LineMode::output);
}

void make_input(Line line, LinePull pull) {
  set_pull(line, pull);
  set_mode(line, LineMode::input);
}

void prepare_open_drain(Line line, std::uint32_t function) {
  write(line, true);
  set_field(line.port->OTYPER, line.number, 1, 1);
  set_pull(line, LinePull::up);  // parallel to the board's resistors
  set_function(line, function);
}

void make_alternate(Line line, std::uint32_t function, LinePull pull) {
  constexpr std::uint32_t high_speed = 2;
  set_field(line.port->OTYPER, line.number, 1, 0);
  set_field(line.port->OSPEEDR, line.number, 2, high_speed);
  set_pull(line, pull);
  set_function(line, function);
  set_mode(line, LineMode::alternate);
}

}  // namespace giga
}  // namespace r4
