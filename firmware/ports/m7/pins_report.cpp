// SPDX-License-Identifier: GPL-3.0-or-later
#include "pins_report.hpp"

#include <initializer_list>

#include "../../../protocol/datagram/numbers.hpp"
#include "links/uart.hpp"

namespace r4 {
namespace m7 {

volatile std::uint32_t PinsReport::datagram_ticks_ = 0;

PinsReport::PinsReport(sim::BoardModel& board, BoardClock& clock, const BoardLink& link,
                       std::uint32_t base)
    : board_(board), clock_(clock), link_(link), base_(base) {}

void PinsReport::start() {
  board_.chips().bus.set_observer(this);
  look();
}

void PinsReport::look() {
  const InterruptsHeld held;
  const sim::Pins pins = board_.pins();
  if ((pins == last_ && noted_ != 0) || noted_ - told_ == notes_max) return;
  last_ = pins;
  Note& note = notes_[noted_ % notes_max];
  note.t_ms = clock_.now_ms();
  note.t_us = clock_.now_us();
  note.heard_us = note.t_us - (BoardClock::ticks() - datagram_ticks_) / BoardClock::ticks_per_us;
  note.fed_ms = link_.fed_ms();
  note.pins = pins;
  noted_ = noted_ + 1;
}

void PinsReport::poll() {
  constexpr std::size_t bytes_a_turn = 64;
  look();  // steppers move without transfers
  if (sent_ == size_) {
    if (told_ == noted_) return;
    write_line(notes_[told_ % notes_max]);
    told_ = told_ + 1;
  }
  const std::size_t left = size_ - sent_;
  const std::size_t now = left < bytes_a_turn ? left : bytes_a_turn;
  Log(base_).text(Text(line_ + sent_, now));
  sent_ += now;
}

void PinsReport::write_line(const Note& note) {
  sent_ = 0;
  size_ = 0;
  for (const std::uint32_t number : {note.t_ms, note.t_us, note.heard_us, note.fed_ms}) add(number);
  const sim::Pins& pins = note.pins;
  add(std::uint32_t{static_cast<const sim::ChipPins&>(pins).is_safe()});
  for (const Drive& drive : pins.osmc) add(drive);
  for (const Drive& drive : pins.dhb12) add(drive);
  for (const std::uint32_t us : pins.servo_us) add(us);
  add(std::uint32_t{pins.relays});
  for (const Bldc& bldc : pins.bldc) {
    add(std::uint32_t{bldc.speed});
    add(static_cast<std::uint32_t>(bldc.direction));
    add(std::uint32_t{bldc.brake});
  }
  for (const sim::Pins::Stepper& stepper : pins.stepper) {
    add(stepper.position);
    add(std::int32_t{stepper.stepping});
  }
  line_[size_ - 1] = '\n';
}

void PinsReport::add(const Drive& drive) {
  add(std::uint32_t{drive.pwm});
  add(static_cast<std::uint32_t>(drive.direction));
}

template <class Number>
void PinsReport::add(Number number) {
  char* const end = write_number(line_ + size_, number);
  *end = ' ';
  size_ = static_cast<std::size_t>(end + 1 - line_);
}

}  // namespace m7
}  // namespace r4
