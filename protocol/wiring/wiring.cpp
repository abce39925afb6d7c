// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/wiring/wiring.hpp"

#include "giga_pins.hpp"

namespace r4 {
namespace {

bool is_pin(Terminal terminal) {
  return terminal == Terminal::pin || terminal == Terminal::interrupt_pin ||
         terminal == Terminal::analog_pin;
}

bool within(int number, int least, int most) { return number >= least && number <= most; }

// True if the place exists. fault_of() decides whether it may be used.
bool exists(Terminal terminal, int number, bool at_second_bus) {
  constexpr int drive_lines = 2 * pca9685_lines;
  constexpr int all_pca9685 = 0x70;
  constexpr int atecc608a = 0x60;
  switch (terminal) {
    case Terminal::bus:
      return number <= 1;
    case Terminal::pca9685:
      return within(number, 0x40, i2c_last_address) && number != all_pca9685;
    case Terminal::mcp23017:
      return within(number, 0x20, 0x27);
    case Terminal::mcp4728:
      return within(number, 0x60, 0x67) && !(at_second_bus && number == atecc608a);
    case Terminal::pin:
    case Terminal::interrupt_pin:
    case Terminal::analog_pin:
      return number < giga_pin_count;
    case Terminal::drive_line:
      return number < drive_lines;
    case Terminal::servo_line:
      return within(number, drive_lines, drive_lines + pca9685_lines - 1);
    case Terminal::dac_output:
      return number < 4;
    case Terminal::expander_bit:
      return number < 16;
  }
  return false;
}

WiringFault fault_of(const SignalRow& row, Place place, bool at_second_bus) {
  if (place.option() && !(row.has_option && place.connected())) return WiringFault::option;
  if (!place.connected()) {
    return row.terminal == Terminal::bus ? WiringFault::place : WiringFault::none;
  }
  const int number = place.number();
  if (!exists(row.terminal, number, at_second_bus)) return WiringFault::place;
  if (!is_pin(row.terminal)) return WiringFault::none;
  if (giga_pins[number].user != PinUser::none) return WiringFault::pin_taken;
  if (row.terminal == Terminal::analog_pin &&
      !within(number, first_analog_pin, first_analog_pin + analog_pin_count - 1)) {
    return WiringFault::no_converter;
  }
  if (row.terminal == Terminal::interrupt_pin && giga_pins[number].number == wifi_interrupt_line) {
    return WiringFault::interrupt_line;
  }
  return WiringFault::none;
}

// Places of one family share one numbering: two signals of a family must not share a number.
enum class Family : std::uint8_t { bus, address, pin, line, dac_output, expander_bit };

Family family_of(Terminal terminal) {
  switch (terminal) {
    case Terminal::bus:
      return Family::bus;
    case Terminal::pca9685:
    case Terminal::mcp23017:
    case Terminal::mcp4728:
      return Family::address;
    case Terminal::pin:
    case Terminal::interrupt_pin:
    case Terminal::analog_pin:
      return Family::pin;
    case Terminal::drive_line:
    case Terminal::servo_line:
      return Family::line;
    case Terminal::dac_output:
      return Family::dac_output;
    case Terminal::expander_bit:
      break;
  }
  return Family::expander_bit;
}

// Both signals must be connected, to places that exist.
WiringFault clash(const SignalRow& a, Place at_a, const SignalRow& b, Place at_b) {
  if (family_of(a.terminal) != family_of(b.terminal)) return WiringFault::none;
  if (at_a.number() == at_b.number()) return WiringFault::twice;
  if (a.terminal == Terminal::interrupt_pin && b.terminal == Terminal::interrupt_pin &&
      giga_pins[at_a.number()].number == giga_pins[at_b.number()].number) {
    return WiringFault::interrupt_line;
  }
  return WiringFault::none;
}

WiringFault fault_with_partner(const SignalRow& row, Place place, Place partner) {
  if (place.connected() != partner.connected()) return WiringFault::alone;
  if (row.terminal != Terminal::drive_line || !place.connected()) return WiringFault::none;
  const int a = place.number();
  const int b = partner.number();
  const int lines = (a < b ? b - a : a - b) + 1;
  return a / pca9685_lines == b / pca9685_lines && lines <= partner_lines ? WiringFault::none
                                                                          : WiringFault::apart;
}

}  // namespace

SignalKind signal_kind(int index) {
  int kind = 0;
  while (kind + 1 < signal_kind_count && signal_rows[kind + 1].first <= index) ++kind;
  return static_cast<SignalKind>(kind);
}

bool operator==(const Wiring& a, const Wiring& b) {
  for (int i = 0; i < signal_count; ++i) {
    if (a.places[i] != b.places[i]) return false;
  }
  return true;
}

WiringCheck check(const Wiring& wiring) {
  WiringCheck result;
  const auto found = [&result](WiringFault fault, int signal, int other) {
    if (fault == WiringFault::none) return false;
    result.fault = fault;
    result.signal = static_cast<std::uint8_t>(signal);
    result.other = static_cast<std::uint8_t>(other);
    return true;
  };
  const bool at_second_bus = wiring.at(SignalKind::chip_bus).number() == 1;
  for (int i = 0; i < signal_count; ++i) {
    const SignalRow& row = row_of(signal_kind(i));
    const Place place = wiring.places[i];
    const WiringFault fault = fault_of(row, place, at_second_bus);
    if (found(fault, i, WiringCheck::no_signal)) return result;
    if (!place.connected()) continue;
    for (int other = 0; other < i; ++other) {
      const Place before = wiring.places[other];
      if (!before.connected()) continue;
      if (found(clash(row, place, row_of(signal_kind(other)), before), i, other)) return result;
    }
  }
  for (int i = 0; i < signal_count; ++i) {
    const SignalRow& row = row_of(signal_kind(i));
    const int partner = row_of(row.partner).first + i - row.first;
    const bool alone = wiring.places[i].connected();
    const WiringFault fault = fault_with_partner(row, wiring.places[i], wiring.places[partner]);
    if (found(fault, alone ? i : partner, alone ? partner : i)) return result;
  }
  return result;
}

}  // namespace r4
