// SPDX-License-Identifier: GPL-3.0-or-later
// The wiring of a board: the pin of the Giga or the line of a chip for each signal
// (docs/reference/wiring.md). The signals are rows of tables/board.def. The board and a host check
// a wiring with the same check(). wiring_file.hpp reads and writes text files.
#pragma once

#include <cstdint>

#include "../config.hpp"
#include "../state.hpp"
#include "../vocabulary.hpp"

namespace r4 {

// The chips on the board's I2C bus. The first three are PCA9685.
enum class Chip : std::uint8_t { osmc_pwm, dhb12_pwm, servo_pwm, expander, dac, count };
constexpr int chip_count = static_cast<int>(Chip::count);
constexpr int pca9685_lines = 16;

// The kinds of places to which signals are connected, and the numbers of the places.
enum class Terminal : std::uint8_t {
  bus,            // 0: SDA and SCL of the Giga (D20 D21), 1: SDA1 and SCL1
  pca9685,        // address, 0x40-0x77 without 0x70, which all PCA9685 share
  mcp23017,       // address, 0x20-0x27
  mcp4728,        // address, 0x60-0x67; on SDA1 and SCL1 not 0x60, the Giga's ATECC608A
  pin,            // D number of the Giga
  interrupt_pin,  // D number; interrupt lines are unique
  analog_pin,     // D number of a pin with a converter: A0-A7 are D76-D83
  drive_line,     // 16 x chip + line: Chip::osmc_pwm or dhb12_pwm, whose frequency is 1 kHz
  servo_line,     // 16 x chip + line: Chip::servo_pwm, whose frequency is 50 Hz
  dac_output,     // 0-3: A-D
  expander_bit,   // 0-7: bit of port A, 8-15: of port B
};

enum class SignalKind : std::uint8_t {
#define R4_SIGNAL(kind, ...) kind,
#include "../tables/board.def"
  count
};
constexpr int signal_kind_count = static_cast<int>(SignalKind::count);

// The index of each kind's first and last signal in a Wiring.
namespace signals {
enum Index : std::uint8_t {
#define R4_SIGNAL(kind, terminal, channels, ...) kind, kind##_last = kind + (channels)-1,
#include "../tables/board.def"
  count
};
}  // namespace signals
constexpr int signal_count = signals::count;
static_assert(signals::dac_chip - signals::osmc_chip == chip_count - 1,
              "the rows of the chips are in the order of Chip");

struct SignalRow {
  Terminal terminal;
  std::uint8_t first;     // index of channel 1
  std::uint8_t channels;  // numbered from 1
  SignalKind partner;     // both are connected or neither; itself: no partner
  bool has_option;
};
constexpr SignalRow signal_rows[] = {
#define R4_SIGNAL(kind, terminal, channels, partner, name, part, option, ...) \
  {Terminal::terminal, signals::kind, channels, SignalKind::partner, sizeof(option) > 1},
#include "../tables/board.def"
};
constexpr const SignalRow& row_of(SignalKind kind) {
  return signal_rows[static_cast<std::size_t>(kind)];
}
constexpr int signal_index(SignalKind kind, int channel = 1) {
  return row_of(kind).first + channel - 1;
}
// `index`: 0 to signal_count - 1.
R4LINK_API SignalKind signal_kind(int index);

// One byte, as stored and sent.
struct Place {
  static constexpr std::uint8_t nowhere = 0x7F;
  static constexpr std::uint8_t option_bit = 0x80;
  std::uint8_t byte = nowhere;

  constexpr bool connected() const { return number() != nowhere; }
  constexpr std::uint8_t number() const { return byte & nowhere; }
  constexpr bool option() const { return (byte & option_bit) != 0; }
  friend constexpr bool operator==(Place a, Place b) { return a.byte == b.byte; }
  friend constexpr bool operator!=(Place a, Place b) { return a.byte != b.byte; }
};

struct Wiring {
  Place places[signal_count];

  // Nothing is connected; the bus is D20 and D21.
  Wiring() { at(SignalKind::chip_bus).byte = 0; }

  Place& at(SignalKind kind, int channel = 1) { return places[signal_index(kind, channel)]; }
  Place at(SignalKind kind, int channel = 1) const { return places[signal_index(kind, channel)]; }
  // The address of a chip; Place::nowhere: the chip is not fitted, and its lines have no effect.
  Place chip(Chip chip) const { return places[signals::osmc_chip + static_cast<int>(chip)]; }
  bool has_pca9685() const {
    return chip(Chip::osmc_pwm).connected() || chip(Chip::dhb12_pwm).connected() ||
           chip(Chip::servo_pwm).connected();
  }
};
R4LINK_API bool operator==(const Wiring& a, const Wiring& b);
inline bool operator!=(const Wiring& a, const Wiring& b) { return !(a == b); }

// The plan in tables/board.def: the wiring of a board to which no wiring was given.
R4LINK_API Wiring plan_wiring();

enum class WiringSource : std::uint8_t {
  plan,     // no wiring was given, and the plan was not confirmed
  given,    // the owner gave it
  damaged,  // the stored wiring cannot be read: nothing is connected
};
R4LINK_API const char* to_text(WiringSource source);

struct BoardWiring {
  WiringSource source = WiringSource::plan;
  bool in_use = false;  // false: used from the board's next start
  Wiring wiring;
};

enum class WiringFault : std::uint8_t {
  none,
  place,           // no such pin, line, bit, output, bus or address
  option,          // the signal has no option, or is not connected
  pin_taken,       // the core, a transport or a device of the board needs the pin
  no_converter,    // not an analog pin
  twice,           // `other` has the same place
  interrupt_line,  // `other`, or WiFi (no_signal), has the same interrupt line
  alone,           // the partner, `other`, is not connected
  apart,           // the partner, `other`, is on another chip, or more than partner_lines away
};

// The two lines of a motor change in one transfer. A transfer carries at most this many lines.
constexpr int partner_lines = 11;

// The first fault of a wiring.
struct WiringCheck {
  static constexpr std::uint8_t no_signal = 0xFF;
  WiringFault fault = WiringFault::none;
  std::uint8_t signal = no_signal;  // index in Wiring
  std::uint8_t other = no_signal;
};
// WiringFault::none if the wiring obeys the rules of docs/reference/wiring.md.
R4LINK_API WiringCheck check(const Wiring& wiring);

}  // namespace r4
