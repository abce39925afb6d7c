// SPDX-License-Identifier: GPL-3.0-or-later
// The commands of the board (docs/reference/protocol.md, section 3), from board.def: a row for each
// kind of command and for each kind of value.
//     r4::row_of(r4::CommandKind::servo).channels                // 16
//     r4::row_of(r4::CommandValue::pulse).max                    // 2500, microseconds
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>

#include "../text.hpp"
#include "../vocabulary.hpp"

namespace r4 {

constexpr Text host_heartbeat_word("ROS2-R4");

enum class CommandKind : std::uint8_t {
#define R4_COMMAND(kind, ...) kind,
#include "board.def"
};

enum class CommandEffect : std::uint8_t {
  none,
  device,  // may move a device on the user's bus or UART; refused in the safe state
  output,  // may move an output; refused in the safe state; may be part of a group
};

// The member of `Command` that holds a value, and the value's text form.
enum class ValueRole : std::uint8_t {
  channel,
  value,
  address,  // Command::value; readers also accept 0x68
  speed,
  direction,
  on,
  on_off,  // Command::on, as On or Off; readers also accept 1 and 0
  count,
  period_ms,
  bytes,  // Command::text, as "x3B00". From this role on, ranges are sizes
  text,
  text2,
  list,  // Command::text: this value and all further values
};
constexpr bool is_text(ValueRole role) { return role >= ValueRole::bytes; }

enum class CommandValue : std::uint8_t {
#define R4_COMMAND_VALUE(value, ...) value,
#define R4_OPTIONAL_VALUE(value, ...) value,
#include "board.def"
  end
};

struct ValueRow {
  constexpr ValueRow(CommandValue of, ValueRole in, std::int32_t least, std::int32_t most)
      : value(of), role(in), min(least), max(most) {}
  // An optional value. `none`: the value of the member if the value is omitted.
  constexpr ValueRow(CommandValue of, ValueRole in, std::int32_t least, std::int32_t most,
                     std::int32_t none)
      : value(of), role(in), optional(true), min(least), max(most), missing(none) {}

  CommandValue value;
  ValueRole role;
  bool optional = false;
  std::int32_t min;
  std::int32_t max;  // for a channel: CommandRow::channels
  std::int32_t missing = 0;
};

constexpr std::int32_t int32_max = 0x7FFFFFFF;
constexpr ValueRow value_rows[] = {
#define R4_COMMAND_VALUE(value, role, min, max, ...) \
  {CommandValue::value, ValueRole::role, min, max},
#define R4_OPTIONAL_VALUE(value, role, min, max, missing, ...) \
  {CommandValue::value, ValueRole::role, min, max, missing},
#include "board.def"
};
constexpr const ValueRow& row_of(CommandValue value) {
  return value_rows[static_cast<std::size_t>(value)];
}

struct CommandRow {
  constexpr CommandRow(CommandKind of, char name, Text first, CommandEffect moves, int count,
                       std::initializer_list<CommandValue> all)
      : word(first),
        kind(of),
        letter(name),
        effect(moves),
        channels(static_cast<std::uint8_t>(count)) {
    for (const CommandValue value : all) {
      values[most++] = value;
      if (!row_of(value).optional) ++least;
    }
  }
  constexpr const CommandValue* begin() const { return values; }
  constexpr const CommandValue* end() const { return values + most; }

  Text word;  // the first value, "STOP", if the kind needs one beside the letter
  CommandKind kind;
  char letter;
  CommandEffect effect;
  std::uint8_t channels;   // 0: none
  std::uint8_t least = 0;  // number of values, without the word
  std::uint8_t most = 0;
  CommandValue values[5] = {};  // after the word; at most one is optional
};

namespace short_names {
using V = CommandValue;
constexpr CommandRow command_rows[] = {
#define R4_VALUES(...) \
  { __VA_ARGS__ }
#define R4_COMMAND(kind, letter, word, effect, channels, values, ...) \
  {CommandKind::kind, letter, word, CommandEffect::effect, channels, values},
#include "board.def"
};
#undef R4_VALUES
}  // namespace short_names
using short_names::command_rows;
constexpr std::size_t command_kinds = sizeof command_rows / sizeof *command_rows;
constexpr const CommandRow& row_of(CommandKind kind) {
  return command_rows[static_cast<std::size_t>(kind)];
}

constexpr bool fits(const ValueRow& value) {
  switch (value.role) {
    case ValueRole::direction:
    case ValueRole::on:
    case ValueRole::on_off:
      return value.min == 0 && value.max == 1;
    case ValueRole::count:
      return value.min >= 0 && value.max <= 0xFF;
    case ValueRole::period_ms:
      return value.min >= 0 && value.max <= 0xFFFF;
    case ValueRole::bytes:
      return value.max <= uart_max_write;
    default:
      return true;
  }
}
constexpr bool has_values_that_fit() {
  for (const ValueRow& value : value_rows) {
    if (!fits(value)) return false;
  }
  for (const CommandRow& row : command_rows) {
    if (row.most - row.least > 1) return false;
    if (row.effect == CommandEffect::output && row.channels == 0) return false;
    for (const CommandValue* value = row.begin(); value + 1 < row.end(); ++value) {
      if (row_of(*value).role == ValueRole::list) return false;
    }
  }
  return true;
}
static_assert(has_values_that_fit(),
              "a value fits into its member; one may be left out; a list is the last");
static_assert(encoder_channels == stepper_channels, "Z sets both");

// A bit mask of the kinds with at least this effect: no table is needed at run time.
constexpr std::uint32_t kinds_that_move(CommandEffect least) {
  std::uint32_t kinds = 0;
  for (const CommandRow& row : command_rows) {
    if (row.effect >= least) kinds |= std::uint32_t{1} << static_cast<unsigned>(row.kind);
  }
  return kinds;
}
constexpr bool joins_groups(CommandKind kind) {
  constexpr std::uint32_t kinds = kinds_that_move(CommandEffect::output);
  return (kinds >> static_cast<unsigned>(kind) & 1U) != 0;
}
// True if the command may move an output or a device: it is refused in the safe state.
constexpr bool drives_output(CommandKind kind) {
  constexpr std::uint32_t kinds = kinds_that_move(CommandEffect::device);
  return (kinds >> static_cast<unsigned>(kind) & 1U) != 0;
}
// True if an identity (`I`) confirms the command, which needs no control.
constexpr bool is_question(CommandKind kind) {
  return kind == CommandKind::identify || kind == CommandKind::ask_wiring;
}

}  // namespace r4
