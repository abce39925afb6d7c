// SPDX-License-Identifier: GPL-3.0-or-later
// Commands for connected devices: X (docs/reference/protocol.md). Bytes are written as x and two
// hexadecimal digits each: "x3B00". The x distinguishes bytes from numbers. "x" alone is not valid.
#pragma once

#include <cstdint>

#include "r4link/command.hpp"
#include "r4link/datagram.hpp"
#include "r4link/messages/datagram_writer.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {

// A reading that the board repeats by itself.
struct I2cPoll {
  std::uint8_t address = 0;  // 0: none
  std::uint8_t register_size = 0;
  std::uint8_t register_bytes[i2c_max_register_bytes] = {};
  std::uint8_t count = 0;
  std::uint16_t period_ms = 0;
  bool on() const { return address != 0; }
};
bool operator==(const I2cPoll& a, const I2cPoll& b);
inline bool operator!=(const I2cPoll& a, const I2cPoll& b) { return !(a == b); }

struct UartMode {
  std::uint32_t baud = 0;  // 0: off
  char parity = 'N';       // N, E, O
  std::uint8_t stop_bits = 1;
  bool on() const { return baud != 0; }
};
inline bool operator==(const UartMode& a, const UartMode& b) {
  return a.baud == b.baud && a.parity == b.parity && a.stop_bits == b.stop_bits;
}
inline bool operator!=(const UartMode& a, const UartMode& b) { return !(a == b); }

constexpr bool is_device_command(CommandKind kind) {
  return kind >= CommandKind::i2c_write && kind <= CommandKind::i2c_poll_off;
}

// The poll of a valid X:POLL or X:OFF.
I2cPoll poll_of(const Command& command);

// "104:x3B:14:10" or "off". Refusal::format or ::range; `out` is written only on Refusal::none.
Refusal parse_poll(Text value, I2cPoll& out);
// "255:xFFFF:32:60000"
constexpr std::size_t max_poll_text = 24;
Text write_poll(const I2cPoll& poll, char (&buffer)[max_poll_text]);

// The value of a setting: "115200:8N1" (always 8 data bits) or "off". Refusals as parse_poll().
Refusal parse_uart_mode(Text value, UartMode& out);
// "460800:8N1"
constexpr std::size_t max_uart_text = 16;
Text write_uart_mode(const UartMode& mode, char (&buffer)[max_uart_text]);

// Reads bytes from text. Refusal::format if not valid, ::range if longer than `most` bytes.
Refusal parse_bytes(Text text, std::uint8_t* out, std::size_t most, std::uint8_t& size);
void write_bytes(DatagramWriter& writer, const std::uint8_t* bytes, std::size_t size);

}  // namespace r4
