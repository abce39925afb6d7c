// SPDX-License-Identifier: GPL-3.0-or-later
#include "device_command.hpp"

#include "../datagram/numbers.hpp"

namespace r4 {
namespace {

constexpr std::size_t max_values = 6;

// The words of X, and how many values a command has, its word included.
struct Word {
  Text text;
  CommandKind kind;
  std::uint8_t least;
  std::uint8_t most;
};
constexpr Word words[] = {
    {"READ", CommandKind::i2c_read, 4, 4}, {"WRITE", CommandKind::i2c_write, 3, 4},
    {"SCAN", CommandKind::i2c_scan, 1, 1}, {"POLL", CommandKind::i2c_poll, 6, 6},
    {"OFF", CommandKind::i2c_poll, 2, 2},  {"UART", CommandKind::uart_write, 3, 3},
    {"DAC", CommandKind::dac, 3, 3},
};
constexpr std::size_t word_count = sizeof words / sizeof words[0];
constexpr Text off_word("OFF");
constexpr Text off_value("off");

// Commands that nobody is in a hurry for: of what they have in common there is one copy.
#define R4_ONE_COPY __attribute__((noinline))

// Takes numbers, and notes what is wrong with one.
class Numbers {
 public:
  R4_ONE_COPY int number(Text text) {
    std::int32_t value = 0;
    if (!parse_number(text, value)) note(is_whole_number(text) ? Refusal::range : Refusal::format);
    return value;
  }
  // Decimal, or hexadecimal as 0x68.
  R4_ONE_COPY int address(Text text) {
    if (text.size() < 3 || text[0] != '0' || text[1] != 'x') return number(text);
    std::uint32_t value = 0;
    if (!parse_hex(text.substr(2), value)) note(Refusal::format);
    return value <= 0x7F ? static_cast<int>(value) : 0;
  }
  // A count that has to be there: at least 1.
  int count(Text text) {
    const int value = number(text);
    return value == 0 ? -1 : value;
  }
  // Address, register, count and period: what is repeated into a slot.
  R4_ONE_COPY Command poll(const Text* values, int slot) {
    return Command::i2c_poll(slot, address(values[0]), values[1], number(values[2]),
                             number(values[3]));
  }
  // The command, if it is right: the graver of what was noted and what the command's check has found.
  R4_ONE_COPY Refusal take(const Command& command, Command& out) const {
    const Refusal checked = check_command(command);
    const Refusal refusal =
        noted_ == Refusal::format || checked == Refusal::none ? noted_ : checked;
    if (refusal == Refusal::none) out = command;
    return refusal;
  }

 private:
  void note(Refusal refusal) {
    if (noted_ != Refusal::format) noted_ = refusal;
  }
  Refusal noted_ = Refusal::none;
};

// `least` to `most` bytes, as text?
Refusal check_bytes(Text text, std::size_t least, std::size_t most) {
  std::uint8_t bytes[uart_max_write];
  std::uint8_t size = 0;
  const Refusal refusal = parse_bytes(text, bytes, most, size);
  return refusal == Refusal::none && size < least ? Refusal::range : refusal;
}

bool is_address(std::int32_t address) {
  return address >= i2c_first_address && address <= i2c_last_address;
}

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

Refusal parse_device_command(const Field& field, Command& out) {
  Text values[max_values];
  const std::size_t count = field.split(values, max_values);
  const Word* word = words;
  while (word != words + word_count && word->text != values[0]) ++word;
  if (values[0].empty()) return Refusal::format;
  if (word == words + word_count) return Refusal::unknown;
  if (count < word->least || count > word->most) return Refusal::format;
  Numbers numbers;
  Command command;
  switch (word->kind) {
    case CommandKind::i2c_read:
      command = Command::i2c_read(numbers.address(values[1]), values[2], numbers.number(values[3]));
      break;
    case CommandKind::i2c_write:
      command = Command::i2c_write(numbers.address(values[1]), values[2],
                                   count == 4 ? numbers.count(values[3]) : 0);
      break;
    case CommandKind::i2c_poll:
      command = count == 2 ? Command::i2c_poll_off(numbers.number(values[1]))
                           : numbers.poll(values + 1, numbers.number(values[5]));
      break;
    case CommandKind::uart_write:
      command = Command::uart_write(numbers.number(values[1]), values[2]);
      break;
    case CommandKind::dac:
      command = Command::dac(numbers.number(values[1]), Millivolts(numbers.number(values[2])));
      break;
    default:
      command = Command::i2c_scan();
      break;
  }
  return numbers.take(command, out);
}

Refusal check_device_command(const Command& command) {
  if (command.kind == CommandKind::i2c_scan) return Refusal::none;
  if (command.kind == CommandKind::uart_write) {
    const Refusal bytes = check_bytes(command.text, 1, uart_max_write);
    const bool there = command.channel >= 1 && command.channel <= uart_channels;
    return bytes != Refusal::format && !there ? Refusal::channel : bytes;
  }
  const bool polls = command.kind == CommandKind::i2c_poll;
  const bool writes = command.kind == CommandKind::i2c_write;
  const bool off = polls && command.count == 0;
  if (!off) {
    const Refusal bytes =
        check_bytes(command.text, writes ? 1 : 0, writes ? i2c_max_bytes : i2c_max_register_bytes);
    if (bytes == Refusal::format) return bytes;
    if (polls && (command.channel < 1 || command.channel > i2c_slots)) return Refusal::channel;
    if (bytes != Refusal::none || !is_address(command.value)) return Refusal::range;
    if (command.count > i2c_max_bytes || (!writes && command.count == 0)) return Refusal::range;
    const bool period =
        command.period_ms >= i2c_min_period_ms && command.period_ms <= i2c_max_period_ms;
    return polls && !period ? Refusal::range : Refusal::none;
  }
  return command.channel < 1 || command.channel > i2c_slots ? Refusal::channel : Refusal::none;
}

void write_device_command(DatagramWriter& writer, const Command& command) {
  const Word* word = words;
  while (word->kind != command.kind) ++word;
  const bool polls = command.kind == CommandKind::i2c_poll;
  const bool off = polls && command.count == 0;
  writer.field("X").value(off ? off_word : word->text);
  if (command.kind == CommandKind::i2c_scan) return;
  if (command.kind == CommandKind::uart_write || command.kind == CommandKind::dac) {
    writer.value(std::uint32_t{command.channel});
    command.kind == CommandKind::dac ? writer.value(command.value) : writer.value(command.text);
    return;
  }
  if (!off) {
    writer.value(command.value).value(command.text);
    const bool counts = command.kind != CommandKind::i2c_write || command.count != 0;
    if (counts) writer.value(std::uint32_t{command.count});
    if (polls) writer.value(std::uint32_t{command.period_ms});
  }
  if (polls) writer.value(std::uint32_t{command.channel});
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
  Text parts[4];
  std::size_t count = 0;
  for (Text rest = value;;) {
    std::size_t size = 0;
    while (size < rest.size() && rest[size] != ':') ++size;
    if (count == 4) return Refusal::format;
    parts[count++] = rest.substr(0, size);
    if (size == rest.size()) break;
    rest = rest.substr(size + 1);
  }
  if (count != 4) return Refusal::format;
  Numbers numbers;
  Command command;
  const Refusal refusal = numbers.take(numbers.poll(parts, 1), command);
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
