// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <iterator>
#include <optional>
#include <string>

#include "../../protocol/wiring/giga_pins.hpp"
#include "names.hpp"
#include "r4link/error.hpp"
#include "r4link/wiring/wiring_file.hpp"

namespace r4 {

namespace {

constexpr const char* bus_names[] = {"D20/D21", "SDA1/SCL1"};
constexpr const char* pca9685_names[] = {"osmc", "dhb12", "servo"};

std::string pin_name(int number) {
  const int analog = number - first_analog_pin;
  const bool is_analog = analog >= 0 && analog < analog_pin_count;
  return is_analog ? fmt::format("A{}", analog) : fmt::format("D{}", number);
}

std::string name_of(Terminal terminal, int number) {
  switch (terminal) {
    case Terminal::bus:
      return bus_names[number & 1];
    case Terminal::pca9685:
    case Terminal::mcp23017:
    case Terminal::mcp4728:
      return fmt::format("{:#04x}", number);
    case Terminal::pin:
    case Terminal::interrupt_pin:
    case Terminal::analog_pin:
      return pin_name(number);
    case Terminal::drive_line:
    case Terminal::servo_line:
      return fmt::format("{}.{}", pca9685_names[std::min(number / pca9685_lines, 2)],
                         number % pca9685_lines);
    case Terminal::dac_output:
      return fmt::format("VOUT{}", static_cast<char>('A' + number % 4));
    case Terminal::expander_bit:
      break;
  }
  return fmt::format("GP{}{}", number < 8 ? 'A' : 'B', number % 8);
}

const char* expected(Terminal terminal) {
  switch (terminal) {
    case Terminal::bus:
      return "D20/D21 or SDA1/SCL1";
    case Terminal::pca9685:
      return "an address of a PCA9685, 0x40 to 0x77 without 0x70, or none";
    case Terminal::mcp23017:
      return "an address of an MCP23017, 0x20 to 0x27, or none";
    case Terminal::mcp4728:
      return "an address of an MCP4728, 0x60 to 0x67 (at SDA1/SCL1 from 0x61), or none";
    case Terminal::pin:
    case Terminal::interrupt_pin:
      return "a pin, D0 to D102 or A0 to A7, or none";
    case Terminal::analog_pin:
      return "an analog pin, A0 to A7, or none";
    case Terminal::drive_line:
      return "a line of a PCA9685 for motors, osmc.0 to osmc.15 or dhb12.0 to dhb12.15, or none";
    case Terminal::servo_line:
      return "a line of the PCA9685 for servos, servo.0 to servo.15, or none";
    case Terminal::dac_output:
      return "an output of the MCP4728, VOUTA to VOUTD, or none";
    case Terminal::expander_bit:
      break;
  }
  return "a line of the MCP23017, GPA0 to GPA7 or GPB0 to GPB7, or none";
}

int end_of_numbers(Terminal terminal) {
  switch (terminal) {
    case Terminal::bus:
      return 2;
    case Terminal::pca9685:
    case Terminal::mcp23017:
    case Terminal::mcp4728:
      return Place::nowhere;
    case Terminal::pin:
    case Terminal::interrupt_pin:
    case Terminal::analog_pin:
      return giga_pin_count;
    case Terminal::drive_line:
    case Terminal::servo_line:
      return 3 * pca9685_lines;
    case Terminal::dac_output:
      return 4;
    case Terminal::expander_bit:
      break;
  }
  return 16;
}

std::optional<int> number_named(Terminal terminal, std::string_view name) {
  for (int number = 0; number < end_of_numbers(terminal); ++number) {
    if (name_of(terminal, number) == name) return number;
  }
  return std::nullopt;
}

std::string why_taken(int pin) {
  switch (giga_pins[pin].user) {
    case PinUser::divider:
      return "is held at half the supply by resistors of the Giga";
    case PinUser::i2c:
      return "belongs to an I2C bus";
    case PinUser::uart:
      return "belongs to a user's UART";
    case PinUser::dac:
      return "is a user's output voltage";
    case PinUser::light:
      return "is the Giga's LED";
    case PinUser::can:
      return "belongs to CAN";
    case PinUser::usb:
      return "switches the supply of the Giga's USB host port";
    case PinUser::wifi:
      return "belongs to the WiFi chip";
    case PinUser::bluetooth:
      return "belongs to the Bluetooth chip";
    case PinUser::boot:
      return "selects the boot loader";
    case PinUser::none:
      break;
  }
  return "is free";
}

int interrupt_line(Place place) { return giga_pins[place.number()].number; }

}  // namespace

const SignalWords& words_of(int signal) {
  static constexpr SignalWords words[] = {
#define R4_SIGNAL(kind, terminal, channels, partner, name, part, option, ...) {name, part, option},
#include "r4link/tables/board.def"
  };
  return words[static_cast<std::size_t>(signal_kind(signal))];
}

std::string shown_word(std::string_view word) {
  constexpr std::size_t most = 40;
  return printable(word.substr(0, most)) + (word.size() > most ? "..." : "");
}

std::string signal_name(int signal) {
  const SignalWords& words = words_of(signal);
  const SignalRow& row = row_of(signal_kind(signal));
  std::string name(words.name);
  if (row.channels > 1) name += fmt::format(" {}", signal - row.first + 1);
  if (!words.part.empty()) name.append(" ").append(words.part);
  return name;
}

int signal_named(std::string_view name) {
  for (int i = 0; i < signal_count; ++i) {
    if (signal_name(i) == name) return i;
  }
  throw Error(ErrorKind::data, shown_word(name),
              "is not a valid signal: expected one such as 'stepper 1 step' or 'handle'",
              "see r4 wiring template");
}

std::string place_name(int signal, Place place) {
  if (!place.connected()) return "none";
  const Terminal terminal = row_of(signal_kind(signal)).terminal;
  std::string name = name_of(terminal, place.number());
  if (place.option()) name.append(" ").append(words_of(signal).option);
  return name;
}

Place place_named(int signal, std::string_view name) {
  const SignalWords& words = words_of(signal);
  const Terminal terminal = row_of(signal_kind(signal)).terminal;
  const std::size_t space = std::min(name.find(' '), name.size());
  const std::string_view word = name.substr(0, space);
  const std::string_view option = name.substr(std::min(space + 1, name.size()));
  Place place;
  if (word != "none" || terminal == Terminal::bus) {
    const std::optional<int> number = number_named(terminal, word);
    if (!number) {
      throw Error(ErrorKind::data, signal_name(signal),
                  fmt::format("'{}' is not a valid place: expected {}", shown_word(word),
                              expected(terminal)),
                  "correct the line");
    }
    place.byte = static_cast<std::uint8_t>(*number);
  }
  if (space == name.size()) return place;
  if (!place.connected() || words.option.empty() || option != words.option) {
    const bool possible = place.connected() && !words.option.empty();
    throw Error(
        ErrorKind::data, signal_name(signal),
        fmt::format("'{}' is not a valid option: expected {}", shown_word(option),
                    possible ? fmt::format("'{}'", words.option) : "nothing after the place"),
        "correct the line");
  }
  place.byte |= Place::option_bit;
  return place;
}

Problem problem_of(const Wiring& wiring, const WiringCheck& found) {
  const int signal = found.signal;
  const SignalRow& row = row_of(signal_kind(signal));
  const Place place = wiring.places[signal];
  const std::string name = place_name(signal, place);
  const bool has_other = found.other != WiringCheck::no_signal;
  const std::string other = has_other ? signal_name(found.other) : "";
  Problem problem;
  problem.kind = ErrorKind::data;
  problem.thing = signal_name(signal);
  switch (found.fault) {
    case WiringFault::none:
      break;
    case WiringFault::place:
      problem.reason = fmt::format("is not at a valid place: expected {}", expected(row.terminal));
      problem.fix = "choose one of these places";
      break;
    case WiringFault::option:
      problem.reason = "has an option that is not valid for this signal";
      problem.fix = "leave the option out";
      break;
    case WiringFault::pin_taken:
      problem.reason = fmt::format("{} {}", name, why_taken(place.number()));
      problem.fix = "choose another pin";
      break;
    case WiringFault::no_converter:
      problem.reason = fmt::format("{} cannot measure a voltage", name);
      problem.fix = "choose one of A0 to A7";
      break;
    case WiringFault::twice:
      problem.reason = fmt::format("{} is already the place of {}", name, other);
      problem.fix = "give each signal its own place";
      break;
    case WiringFault::interrupt_line:
      problem.reason = fmt::format("{} has interrupt line {}, which is also the line of {}", name,
                                   interrupt_line(place), has_other ? other : "the WiFi chip");
      problem.fix = "choose a pin with another interrupt line (docs/reference/wiring.md)";
      break;
    case WiringFault::alone:
      problem.reason = fmt::format("is connected, but {} is not", other);
      problem.fix = "connect both signals or none";
      break;
    case WiringFault::apart:
      problem.reason = fmt::format(
          "{} and {}, {}, are on different chips, or more than {} lines apart", name, other,
          place_name(found.other, wiring.places[found.other]), partner_lines - 1);
      problem.fix = "choose nearer lines, because the two lines of a motor change in one transfer";
      break;
  }
  return problem;
}

}  // namespace r4
