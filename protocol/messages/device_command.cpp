// SPDX-License-Identifier: GPL-3.0-or-later
#include "device_command.hpp"

#include "../datagram/numbers.hpp"
#include "command_field.hpp"

namespace r4 {
namespace {

constexpr Text off_value("off");

}  // namespace

bool operator==(const I2cPoll& a, const I2cPoll& b) {
  if (a.address != b.address || a.register_size != b.register_size || a.count != b.count ||
      a.period_ms != b.period_ms) {
    return false;
  }
  for (int i = 0; i < a.register_size; ++i) {
    if (a.register_bytes[i] != b.register_bytes[i]) return false;
  }
  return true;
}

I2cPoll poll_of(const Command& command) {
  I2cPoll poll;
  if (command.count == 0) return poll;
  poll.address = static_cast<std::uint8_t>(command.value);
  parse_bytes(command.text, poll.register_bytes, i2c_max_register_bytes, poll.register_size);
  poll.count = command.count;
  poll.period_ms = command.period_ms;
  return poll;
}

Refusal parse_poll(Text value, I2cPoll& out) {
  if (value == off_value) {
    out = I2cPoll();
    return Refusal::none;
  }
  constexpr std::size_t size_of_poll = 4;
  Text parts[size_of_poll + 1];
  std::size_t count = 0;
  for (Text rest = value;;) {
    std::size_t size = 0;
    while (size < rest.size() && rest[size] != ':') ++size;
    if (count == size_of_poll) return Refusal::format;
    parts[count++] = rest.substr(0, size);
    if (size == rest.size()) break;
    rest = rest.substr(size + 1);
  }
  parts[count++] = Text("1");  // a slot, which X:POLL requires
  Command command;
  const Refusal refusal = read_values(row_of(CommandKind::i2c_poll), parts, count, command);
  if (refusal == Refusal::none) out = poll_of(command);
  return refusal;
}

Text write_poll(const I2cPoll& poll, char (&buffer)[max_poll_text]) {
  if (!poll.on()) return off_value;
  char* at = write_number(buffer, std::uint32_t{poll.address});
  *at++ = ':';
  *at++ = 'x';
  at = write_hex(at, poll.register_bytes, poll.register_size);
  *at++ = ':';
  at = write_number(at, std::uint32_t{poll.count});
  *at++ = ':';
  at = write_number(at, std::uint32_t{poll.period_ms});
  return Text(buffer, static_cast<std::size_t>(at - buffer));
}

Refusal parse_uart_mode(Text value, UartMode& out) {
  UartMode mode;
  if (value != off_value) {
    constexpr std::size_t framing = 4;  // ":8N1"
    if (value.size() <= framing) return Refusal::format;
    const Text form = value.substr(value.size() - framing);
    const Text baud = value.substr(0, value.size() - framing);
    const char stop = form[3];
    mode.parity = form[2];
    mode.stop_bits = static_cast<std::uint8_t>(stop - '0');
    const bool parity = mode.parity == 'N' || mode.parity == 'E' || mode.parity == 'O';
    if (form[0] != ':' || form[1] != '8' || !parity || (stop != '1' && stop != '2')) {
      return Refusal::format;
    }
    if (!parse_number(baud, mode.baud)) {
      return is_whole_number(baud) ? Refusal::range : Refusal::format;
    }
    if (mode.baud < uart_min_baud || mode.baud > uart_max_baud) return Refusal::range;
  }
  out = mode;
  return Refusal::none;
}

Text write_uart_mode(const UartMode& mode, char (&buffer)[max_uart_text]) {
  if (!mode.on()) return off_value;
  char* at = write_number(buffer, mode.baud);
  *at++ = ':';
  *at++ = '8';
  *at++ = mode.parity;
  *at++ = static_cast<char>('0' + mode.stop_bits);
  return Text(buffer, static_cast<std::size_t>(at - buffer));
}

Refusal parse_bytes(Text text, std::uint8_t* out, std::size_t most, std::uint8_t& size) {
  if (text.empty() || text[0] != 'x' || text.size() % 2 == 0) return Refusal::format;
  const std::size_t bytes = text.size() / 2;
  for (std::size_t i = 0; i < bytes; ++i) {
    std::uint8_t byte = 0;
    if (!parse_hex(text.substr(1 + 2 * i, 2), &byte, 1)) return Refusal::format;
    if (i < most) out[i] = byte;
  }
  if (bytes > most) return Refusal::range;
  size = static_cast<std::uint8_t>(bytes);
  return Refusal::none;
}

void write_bytes(DatagramWriter& writer, const std::uint8_t* bytes, std::size_t size) {
  constexpr std::size_t most = 64;
  char text[1 + 2 * most];
  text[0] = 'x';
  const char* const end = write_hex(text + 1, bytes, size < most ? size : most);
  writer.value(Text(text, static_cast<std::size_t>(end - text)));
}

}  // namespace r4
