// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/command.hpp"

#include "../datagram/numbers.hpp"
#include "command_field.hpp"
#include "device_command.hpp"

namespace r4 {
namespace {

constexpr Text stop_word = row_of(CommandKind::stop).word;
constexpr Text default_fields("DEFAULT");
constexpr Text all_fields("ALL");
// Keeps rare cases out of the loop over values, which runs for every setpoint.
#define R4_SELDOM __attribute__((noinline))

constexpr std::size_t most_values = sizeof CommandRow::values / sizeof(CommandValue);

bool equal_in_any_case(Text text, Text lower) {
  if (text.size() != lower.size()) return false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if ((c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c) != lower[i]) return false;
  }
  return true;
}

// The most serious fault of a command: its form, then its channel, then a range.
class Faults {
 public:
  void note(Refusal found) {
    if (found == Refusal::none || gravest_ == Refusal::format) return;
    if (found == Refusal::format || gravest_ != Refusal::channel) gravest_ = found;
  }
  Refusal gravest() const { return gravest_; }

 private:
  Refusal gravest_ = Refusal::none;
};

Refusal check_number(const CommandRow& row, const ValueRow& value, std::int32_t number) {
  const bool channel = value.role == ValueRole::channel;
  const std::int32_t max = channel ? row.channels : value.max;
  if (number >= value.min && number <= max) return Refusal::none;
  return channel ? Refusal::channel : Refusal::range;
}

Refusal check_text(const ValueRow& value, Text text) {
  if (value.role != ValueRole::bytes) return text.empty() ? Refusal::format : Refusal::none;
  std::uint8_t bytes[uart_max_write];
  std::uint8_t size = 0;
  const Refusal refusal = parse_bytes(text, bytes, static_cast<std::size_t>(value.max), size);
  return refusal == Refusal::none && size < value.min ? Refusal::range : refusal;
}

R4_SELDOM Refusal read_text(const ValueRow& value, Text text, Command& command) {
  (value.role == ValueRole::text2 ? command.text2 : command.text) = text;
  return check_text(value, text);
}

// Reads a number that is not a decimal std::int32_t: another notation, or an error.
R4_SELDOM Refusal read_other_number(ValueRole role, Text text, std::int32_t& number) {
  if (role == ValueRole::on_off) {
    number = equal_in_any_case(text, "on") ? 1 : 0;
    if (number == 1 || equal_in_any_case(text, "off")) return Refusal::none;
  }
  if (role == ValueRole::address && text.size() > 2 && text[0] == '0' && text[1] == 'x') {
    std::uint32_t address = 0;
    if (!parse_hex(text.substr(2), address)) return Refusal::format;
    number = address <= i2c_last_address ? static_cast<std::int32_t>(address) : 0;
    return Refusal::none;
  }
  if (!is_whole_number(text)) return Refusal::format;
  return role == ValueRole::channel ? Refusal::channel : Refusal::range;
}

std::int32_t number_of(const Command& command, ValueRole role) {
  switch (role) {
    case ValueRole::channel:
      return command.channel;
    case ValueRole::speed:
      return command.speed;
    case ValueRole::direction:
      return static_cast<std::int32_t>(command.direction);
    case ValueRole::on:
    case ValueRole::on_off:
      return command.on ? 1 : 0;
    case ValueRole::count:
      return command.count;
    case ValueRole::period_ms:
      return command.period_ms;
    default:
      return command.value;
  }
}

void set_number(Command& command, ValueRole role, std::int32_t number) {
  switch (role) {
    case ValueRole::channel:
      command.channel = static_cast<std::uint8_t>(number);
      break;
    case ValueRole::speed:
      command.speed = number;
      break;
    case ValueRole::direction:
      command.direction = static_cast<Direction>(number);
      break;
    case ValueRole::on:
    case ValueRole::on_off:
      command.on = number != 0;
      break;
    case ValueRole::count:
      command.count = static_cast<std::uint8_t>(number);
      break;
    case ValueRole::period_ms:
      command.period_ms = static_cast<std::uint16_t>(number);
      break;
    default:
      command.value = number;
      break;
  }
}

Text text_of(const Command& command, ValueRole role) {
  return role == ValueRole::text2 ? command.text2 : command.text;
}

bool is_missing(const Command& command, const ValueRow& value) {
  if (!value.optional) return false;
  return is_text(value.role) ? text_of(command, value.role).empty()
                             : number_of(command, value.role) == value.missing;
}

const CommandRow* find_row(char letter, Text word, Refusal& refusal) {
  refusal = Refusal::unknown;
  for (const CommandRow& row : command_rows) {
    if (row.letter != letter) continue;
    if (row.word.empty() || row.word == word) return &row;
    if (word.empty()) refusal = Refusal::format;
  }
  return nullptr;
}

bool add_fields(Text word, FieldSet& set) {
  if (word == default_fields) {
    set.add(FieldSet::paper_default());
  } else if (word == all_fields) {
    set.add(FieldSet::all());
  } else {
    const StateField field = state_field(word);
    if (field == StateField::count) return false;
    set.add(field);
  }
  return true;
}

}  // namespace

bool asks_to_stop(const Datagram& datagram) {
  for (const Field& field : datagram) {
    if (field.name() == "E" && field.values() == stop_word) return true;
  }
  return false;
}

bool stop_number(const Datagram& datagram, std::uint32_t& out) {
  const Field field = datagram.find(stop_number_name);
  if (!field.name().empty() && parse_number(field.values(), out)) return true;
  out = datagram.pnum();
  return datagram.has_pnum();
}

Refusal parse_command(const Field& field, Command& out) {
  if (field.name().size() != 1) return Refusal::unknown;
  Text texts[most_values + 1];
  std::size_t count = field.split(texts, most_values + 1);
  Refusal refusal = Refusal::none;
  const CommandRow* const row = find_row(field.name()[0], texts[0], refusal);
  if (row == nullptr) return refusal;
  const std::size_t word = row->word.empty() ? 0 : 1;
  count -= word;
  if (count > row->most && row->most != 0) {
    const std::size_t last = row->most - 1U;
    if (row_of(row->values[last]).role == ValueRole::list) {
      const char* const list = texts[last + word].data();
      texts[last + word] = Text(list, static_cast<std::size_t>(field.values().end() - list));
      count = row->most;
    }
  }
  return read_values(*row, texts + word, count, out);
}

Refusal read_values(const CommandRow& row, const Text* texts, std::size_t count, Command& out) {
  if (count < row.least || count > row.most) return Refusal::format;
  Faults faults;
  Command command;
  command.kind = row.kind;
  for (const CommandValue each : row) {
    const ValueRow& value = row_of(each);
    const bool given = !value.optional || count == row.most;
    if (is_text(value.role)) {
      if (given) faults.note(read_text(value, *texts++, command));
      continue;
    }
    std::int32_t number = value.missing;
    if (given) {
      const Text text = *texts++;
      Refusal refusal = Refusal::none;
      if (!parse_number(text, number)) refusal = read_other_number(value.role, text, number);
      faults.note(refusal == Refusal::none ? check_number(row, value, number) : refusal);
    }
    set_number(command, value.role, number);
  }
  if (faults.gravest() == Refusal::none) out = command;
  return faults.gravest();
}

Refusal check_command(const Command& command) {
  if (command.kind > CommandKind::watch) return Refusal::unknown;
  const CommandRow& row = row_of(command.kind);
  Faults faults;
  for (const CommandValue each : row) {
    const ValueRow& value = row_of(each);
    if (is_missing(command, value)) continue;
    faults.note(is_text(value.role) ? check_text(value, text_of(command, value.role))
                                    : check_number(row, value, number_of(command, value.role)));
  }
  return faults.gravest();
}

void write_command(DatagramWriter& writer, const Command& command) {
  const CommandRow& row = row_of(command.kind);
  writer.field(Text(&row.letter, 1));
  if (!row.word.empty()) writer.value(row.word);
  for (const CommandValue each : row) {
    const ValueRow& value = row_of(each);
    // A missing value is written if its default is in range (the speed of a stepper).
    if (is_missing(command, value) && (is_text(value.role) || value.missing < value.min)) continue;
    if (value.role == ValueRole::list) {
      writer.values(text_of(command, value.role));
    } else if (is_text(value.role)) {
      writer.value(text_of(command, value.role));
    } else if (value.role == ValueRole::on_off) {
      writer.value(command.on ? Text("On") : Text("Off"));
    } else {
      writer.value(number_of(command, value.role));
    }
  }
}

Refusal parse_fields(Text list, FieldSet& out) {
  FieldSet set;
  for (Text rest = list;;) {
    std::size_t size = 0;
    while (size < rest.size() && rest[size] != ',') ++size;
    if (!add_fields(rest.substr(0, size), set)) return Refusal::unknown;
    if (size == rest.size()) break;
    rest = rest.substr(size + 1);
  }
  out = set;
  return Refusal::none;
}

}  // namespace r4
