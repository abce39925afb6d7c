// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/command.hpp"

#include "../datagram/numbers.hpp"
#include "command_field.hpp"
#include "device_command.hpp"

namespace r4 {
namespace {

constexpr Text stop_word("STOP");
constexpr Text clear_word("CLEAR");
constexpr Text leave_word("LEAVE");
constexpr Text identify_word("ID");
constexpr Text default_fields("DEFAULT");
constexpr Text all_fields("ALL");

// The ranges of a command's channel and value. No channels: the kind has none.
struct Limits {
  int channels;
  std::int32_t min;
  std::int32_t max;
};

constexpr std::int32_t i32_min = -0x7FFFFFFF - 1;
constexpr std::int32_t i32_max = 0x7FFFFFFF;
// In the order of CommandKind.
constexpr Limits output_limits[] = {
    {osmc_channels, 0, pwm_max},          {dhb12_channels, 0, pwm_max},
    {servo_channels, 0, servo_max_us},    {relay_channels, 0, 0},
    {stepper_channels, i32_min, i32_max}, {encoder_channels, 0, 0},
    {bldc_channels, 0, pwm_max},          {dac_channels, 0, dac_max_mv},
};
static_assert(sizeof output_limits / sizeof *output_limits ==
                  static_cast<std::size_t>(CommandKind::dac) + 1,
              "one row for each output");
static_assert(encoder_channels == stepper_channels, "Z sets both");

Limits limits_of(CommandKind kind) {
  if (joins_groups(kind)) return output_limits[static_cast<std::size_t>(kind)];
  if (kind == CommandKind::proximity) return {ultrasonic_channels, 0, proximity_max_cm};
  return {0, 0, 0};
}

// `lower` is in lower case.
bool equal_in_any_case(Text text, Text lower) {
  if (text.size() != lower.size()) return false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if ((c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c) != lower[i]) return false;
  }
  return true;
}

// Reads the values of a field and notes what is wrong with them.
class Values {
 public:
  explicit Values(const Field& field) : count_(field.split(values_, max)) {}

  // Is there this number of values? Asked first, by every command.
  bool count_is(std::size_t expected) {
    if (count_ != expected) bad_format_ = true;
    return count_ == expected;
  }
  std::size_t count() const { return count_; }
  Text text(std::size_t i) const { return values_[i]; }

  // A whole number; one that does not fit is out of range.
  std::int32_t number(std::size_t i) {
    std::int32_t number = 0;
    if (!parse_number(values_[i], number)) {
      (is_whole_number(values_[i]) ? out_of_range_ : bad_format_) = true;
    }
    return number;
  }
  // The number of a cause: from 0.
  std::int32_t cause(std::size_t i) {
    const std::int32_t value = number(i);
    if (value < 0) out_of_range_ = true;
    return value;
  }
  bool flag(std::size_t i) {
    const std::int32_t value = number(i);
    if (value != 0 && value != 1) out_of_range_ = true;
    return value != 0;
  }
  Direction direction(std::size_t i) { return flag(i) ? Direction::forward : Direction::reverse; }
  bool on_or_off(std::size_t i) {
    if (equal_in_any_case(values_[i], "on")) return true;
    if (equal_in_any_case(values_[i], "off")) return false;
    return flag(i);
  }

  // The verdict on `command`, made of these values.
  Refusal judge(const Command& command) const {
    if (bad_format_) return Refusal::format;
    const Refusal refusal = check_command(command);
    return refusal == Refusal::none && out_of_range_ ? Refusal::range : refusal;
  }

 private:
  static constexpr std::size_t max = 4;
  Text values_[max];
  std::size_t count_;
  bool bad_format_ = false;
  bool out_of_range_ = false;
};

// E, H and Q: is it one of the letter's words?
bool read_word(char letter, Text word, CommandKind& out) {
  if (letter == 'H' && word == host_heartbeat_word) {
    out = CommandKind::heartbeat;
  } else if (letter == 'E' && word == stop_word) {
    out = CommandKind::stop;
  } else if (letter == 'E' && word == clear_word) {
    out = CommandKind::clear;
  } else if (letter == 'E' && word == leave_word) {
    out = CommandKind::leave;
  } else if (letter == 'Q' && word == identify_word) {
    out = CommandKind::identify;
  } else {
    return false;
  }
  return true;
}

Command read_clear(Values& v) {
  if (v.count() == 1) return Command::clear();
  return v.count_is(2) ? Command::clear(v.cause(1)) : Command();
}

Command read_stepper(Values& v) {
  if (v.count() == 2)
    return Command::stepper(v.number(1), Steps(v.number(0)), StepsPerSecond(stepper_speed_default));
  if (!v.count_is(3)) return Command();
  return Command::stepper(v.number(2), Steps(v.number(0)), StepsPerSecond(v.number(1)));
}

// The rate, and behind it a list.
Command read_watch(Values& v, Text values) {
  const std::size_t rate = v.text(0).size();
  const bool has_list = values.size() > rate;
  return Command::watch(
      v.number(0), has_list ? Text(values.data() + rate + 1, values.size() - rate - 1) : Text());
}

std::uint32_t number_of(Direction direction) { return static_cast<std::uint32_t>(direction); }

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
  if (!is_command(field)) return Refusal::unknown;
  const char letter = field.name()[0];
  Values v(field);
  Command command;
  switch (letter) {
    case 'H':
    case 'E':
    case 'Q':
      if (v.text(0).empty()) return Refusal::format;
      if (!read_word(letter, v.text(0), command.kind)) return Refusal::unknown;
      if (command.kind == CommandKind::clear) {
        command = read_clear(v);
      } else {
        v.count_is(1);
      }
      break;
    case 'O':
      if (v.count_is(3)) command = Command::osmc(v.number(2), Pwm(v.number(0)), v.direction(1));
      break;
    case 'D':
      if (v.count_is(3)) command = Command::dhb12(v.number(2), Pwm(v.number(0)), v.direction(1));
      break;
    case 'S':
      if (v.count_is(2)) command = Command::servo(v.number(1), Microseconds(v.number(0)));
      break;
    case 'R':
      if (v.count_is(2)) command = Command::relay(v.number(0), v.on_or_off(1));
      break;
    case 'P':
      command = read_stepper(v);
      break;
    case 'Z':
      if (v.count_is(1)) command = Command::zero(v.number(0));
      break;
    case 'B':
      if (v.count_is(4)) {
        command = Command::bldc(v.number(3), Pwm(v.number(0)), v.direction(1), v.flag(2));
      }
      break;
    case 'U':
      if (v.count_is(2)) command = Command::proximity(v.number(1), Centimetres(v.number(0)));
      break;
    case 'W':
      command = read_watch(v, field.values());
      break;
    case 'X':
      return parse_device_command(field, out);
    case 'F':
      command = Command::fields(field.values());
      break;
    case 'C':
      if (v.count_is(2)) command = Command::setting(v.text(0), v.text(1));
      break;
    default:
      return Refusal::unknown;
  }
  const Refusal refusal = v.judge(command);
  if (refusal == Refusal::none) out = command;
  return refusal;
}

Refusal check_command(const Command& command) {
  if (command.kind == CommandKind::fields) {
    return command.text.empty() ? Refusal::format : Refusal::none;
  }
  if (command.kind == CommandKind::setting) {
    return command.text.empty() || command.text2.empty() ? Refusal::format : Refusal::none;
  }
  if (command.kind == CommandKind::clear) {
    return command.value < Command::unnamed_cause ? Refusal::range : Refusal::none;
  }
  if (command.kind == CommandKind::watch) {
    const bool rate = command.value >= 0 && command.value <= state_rate_max_hz;
    return rate ? Refusal::none : Refusal::range;
  }
  const Limits limits = limits_of(command.kind);
  if (limits.channels == 0) {
    return is_device_command(command.kind) ? check_device_command(command) : Refusal::none;
  }
  if (command.channel < 1 || command.channel > limits.channels) return Refusal::channel;
  if (command.value < limits.min || command.value > limits.max) return Refusal::range;
  if (command.direction > Direction::forward) return Refusal::range;
  if (command.kind == CommandKind::stepper &&
      (command.speed < 1 || command.speed > stepper_speed_max)) {
    return Refusal::range;
  }
  return Refusal::none;
}

void write_command(DatagramWriter& writer, const Command& command) {
  const std::uint32_t channel = command.channel;
  switch (command.kind) {
    case CommandKind::heartbeat:
      writer.field("H").value(host_heartbeat_word);
      break;
    case CommandKind::osmc:
      writer.field("O").value(command.value).value(number_of(command.direction)).value(channel);
      break;
    case CommandKind::dhb12:
      writer.field("D").value(command.value).value(number_of(command.direction)).value(channel);
      break;
    case CommandKind::servo:
      writer.field("S").value(command.value).value(channel);
      break;
    case CommandKind::relay:
      writer.field("R").value(channel).value(command.on ? Text("On") : Text("Off"));
      break;
    case CommandKind::stop:
      writer.field("E").value(stop_word);
      break;
    case CommandKind::clear:
      writer.field("E").value(clear_word);
      if (command.value != Command::unnamed_cause) writer.value(command.value);
      break;
    case CommandKind::leave:
      writer.field("E").value(leave_word);
      break;
    case CommandKind::stepper:
      writer.field("P").value(command.value).value(command.speed).value(channel);
      break;
    case CommandKind::zero:
      writer.field("Z").value(channel);
      break;
    case CommandKind::bldc:
      writer.field("B")
          .value(command.value)
          .value(number_of(command.direction))
          .value(std::uint32_t{command.on})
          .value(channel);
      break;
    case CommandKind::proximity:
      writer.field("U").value(command.value).value(channel);
      break;
    case CommandKind::fields:
      writer.field("F").values(command.text);
      break;
    case CommandKind::setting:
      writer.field("C").value(command.text).value(command.text2);
      break;
    case CommandKind::identify:
      writer.field("Q").value(identify_word);
      break;
    case CommandKind::watch:
      writer.field("W").value(command.value);
      if (!command.text.empty()) writer.values(command.text);
      break;
    case CommandKind::i2c_read:
    case CommandKind::i2c_write:
    case CommandKind::i2c_scan:
    case CommandKind::i2c_poll:
    case CommandKind::uart_write:
    case CommandKind::dac:
      write_device_command(writer, command);
      break;
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
