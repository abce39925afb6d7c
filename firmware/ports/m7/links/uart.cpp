// SPDX-License-Identifier: GPL-3.0-or-later
#include "uart.hpp"

#include "../../../../protocol/datagram/numbers.hpp"
#include "../chip/board_clock.hpp"
#include "../chip/registers.hpp"

namespace r4 {
namespace m7 {

namespace {

constexpr std::uint32_t data = 0x00;
constexpr std::uint32_t state = 0x04;
constexpr std::uint32_t control = 0x08;
constexpr std::uint32_t interrupt = 0x0C;  // a 1 clears
constexpr std::uint32_t baud_divider = 0x10;

constexpr std::uint32_t transmit_full = 1;  // bit of `state`
constexpr std::uint32_t receive_full = 2;
constexpr std::uint32_t overrun = 8;
constexpr std::uint32_t transmit_on = 1;  // bit of `control`
constexpr std::uint32_t receive_on = 2;
constexpr std::uint32_t transmit_interrupt_on = 4;
constexpr std::uint32_t receive_interrupt_on = 8;
constexpr std::uint32_t transmit_interrupt = 1;  // bit of `interrupt`
constexpr std::uint32_t receive_interrupt = 2;

constexpr std::uint32_t baud = 1000000;

}  // namespace

void Uart::start() {
  at(base_ + baud_divider) = clock_hz / baud;
  at(base_ + control) = transmit_on | receive_on | transmit_interrupt_on | receive_interrupt_on;
}

void Uart::on_receive_interrupt() {
  at(base_ + interrupt) = receive_interrupt;
  if ((at(base_ + state) & overrun) != 0) {
    at(base_ + state) = overrun;
    overruns_ = overruns_ + 1;
  }
  while ((at(base_ + state) & receive_full) != 0) {
    on_byte(static_cast<char>(at(base_ + data)));
  }
}

void Uart::on_byte(char byte) {
  if (!received_.put(byte)) overruns_ = overruns_ + 1;
  if (detector_.push(byte)) stop_ = true;
  if (byte == '\n') last_line_ticks_ = BoardClock::ticks();
}

void Uart::on_transmit_interrupt() {
  at(base_ + interrupt) = transmit_interrupt;
  fill();
}

// Call in the UART's interrupt, or with interrupts off.
void Uart::fill() {
  char byte = 0;
  while ((at(base_ + state) & transmit_full) == 0 && lines_.take(byte)) {
    at(base_ + data) = static_cast<unsigned char>(byte);
  }
}

void Uart::send(Text datagram, Priority priority, std::uint32_t) {
  if (priority == Priority::state) {
    lines_.put_state(datagram);
  } else {
    lines_.put(datagram);
  }
  interrupts_off();
  fill();
  interrupts_on();
}

void Uart::poll(std::uint32_t now_ms) {
  interrupts_off();
  lines_.poll(now_ms);
  fill();
  interrupts_on();
}

Log::Log(std::uint32_t base) : base_(base) {
  at(base_ + baud_divider) = clock_hz / baud;
  at(base_ + control) = transmit_on;
}

const Log& Log::text(Text text) const {
  constexpr int patience = 100000;
  for (const char c : text) {
    for (int i = 0; i < patience && (at(base_ + state) & transmit_full) != 0; ++i) {
    }
    at(base_ + data) = static_cast<unsigned char>(c);
  }
  return *this;
}

const Log& Log::hex(std::uint32_t value) const {
  char digits[max_number_text];
  return text("0x").text(Text(digits, static_cast<std::size_t>(write_hex(digits, value) - digits)));
}

const Log& Log::number(std::uint32_t value) const {
  char digits[max_number_text];
  return text(Text(digits, static_cast<std::size_t>(write_number(digits, value) - digits)));
}

}  // namespace m7
}  // namespace r4
