// SPDX-License-Identifier: GPL-3.0-or-later
// The commands of the board (docs/protocol.md, section 3): a row for each kind, made of values that
// have a row each. Parsing, range checks and writing (protocol/messages/command.cpp) read these
// tables, and so do help and descriptions (host/commands/), which add the words for people.
//
//     r4::row_of(r4::CommandKind::servo).channels                // 16
//     r4::row_of(r4::CommandValue::pulse).max                    // 2500, microseconds
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>

#include "../text.hpp"
#include "../vocabulary.hpp"

namespace r4 {

// The value of a host's heartbeat.
constexpr Text host_heartbeat_word("ROS2-R4");

// In the order of `command_rows`: kinds that join groups come first, and `watch` is the last.
enum class CommandKind : std::uint8_t {
  osmc,
  dhb12,
  servo,
  relay,
  stepper,
  zero,
  bldc,
  dac,
  i2c_write,
  uart_write,
  i2c_read,
  i2c_scan,
  i2c_poll,
  i2c_poll_off,
  proximity,
  heartbeat,
  stop,
  clear,
  leave,
  fields,
  setting,
  identify,
  watch,
};
constexpr std::size_t command_kinds = static_cast<std::size_t>(CommandKind::watch) + 1;

// The effect of a command.
enum class CommandEffect : std::uint8_t {
  none,
  device,  // may move a device on a bus or UART of the user. Refused in the safe state
  output,  // may move an output. Refused in the safe state; may be part of a group
};

// The member of `Command` that holds a value, and how the value is written.
enum class ValueRole : std::uint8_t {
  channel,
  value,
  address,  // Command::value; 0x68 is read, too
  speed,
  direction,
  on,
  on_off,  // Command::on, as On or Off; 1 and 0 are read, too
  count,
  period_ms,
  bytes,  // Command::text, as "x3B00". From here on, a range is one of sizes
  text,
  text2,
  list,  // Command::text, with all values that follow
};
constexpr bool is_text(ValueRole role) { return role >= ValueRole::bytes; }

// In the order of `value_rows`.
enum class CommandValue : std::uint8_t {
  channel,
  device_channel,
  uart,
  slot,
  pwm,
  motor_speed,
  direction,
  brake,
  pulse,
  on_off,
  position,
  step_rate,
  threshold,
  millivolts,
  address,
  register_bytes,
  written_bytes,
  sent_bytes,
  count,
  answer_count,
  period,
  cause,
  names,
  watched_names,
  rate,
  key,
  setting,
  end
};
constexpr std::size_t command_values = static_cast<std::size_t>(CommandValue::end);

struct ValueRow {
  constexpr ValueRow(CommandValue of, ValueRole in, std::int32_t least, std::int32_t most)
      : value(of), role(in), min(least), max(most) {}
  // An optional value. The member is `none` if the value is left out.
  constexpr ValueRow(CommandValue of, ValueRole in, std::int32_t least, std::int32_t most,
                     std::int32_t none)
      : value(of), role(in), optional(true), min(least), max(most), missing(none) {}

  CommandValue value;
  ValueRole role;
  bool optional = false;
  std::int32_t min;
  std::int32_t max;  // of a channel: CommandRow::channels
  std::int32_t missing = 0;
};

constexpr std::int32_t int32_max = 0x7FFFFFFF;
constexpr ValueRow value_rows[] = {
    {CommandValue::channel, ValueRole::channel, 1, 0},
    {CommandValue::device_channel, ValueRole::channel, 1, 0},
    {CommandValue::uart, ValueRole::channel, 1, 0},
    {CommandValue::slot, ValueRole::channel, 1, 0},
    {CommandValue::pwm, ValueRole::value, 0, pwm_max},
    {CommandValue::motor_speed, ValueRole::value, 0, pwm_max},
    {CommandValue::direction, ValueRole::direction, 0, 1},
    {CommandValue::brake, ValueRole::on, 0, 1},
    {CommandValue::pulse, ValueRole::value, 0, servo_max_us},
    {CommandValue::on_off, ValueRole::on_off, 0, 1},
    {CommandValue::position, ValueRole::value, -int32_max - 1, int32_max},
    {CommandValue::step_rate, ValueRole::speed, 1, stepper_speed_max, stepper_speed_default},
    {CommandValue::threshold, ValueRole::value, 0, proximity_max_cm},
    {CommandValue::millivolts, ValueRole::value, 0, dac_max_mv},
    {CommandValue::address, ValueRole::address, i2c_first_address, i2c_last_address},
    {CommandValue::register_bytes, ValueRole::bytes, 0, i2c_max_register_bytes},
    {CommandValue::written_bytes, ValueRole::bytes, 1, i2c_max_bytes},
    {CommandValue::sent_bytes, ValueRole::bytes, 1, uart_max_write},
    {CommandValue::count, ValueRole::count, 1, i2c_max_bytes},
    {CommandValue::answer_count, ValueRole::count, 1, i2c_max_bytes, 0},
    {CommandValue::period, ValueRole::period_ms, i2c_min_period_ms, i2c_max_period_ms},
    {CommandValue::cause, ValueRole::value, 0, int32_max, -1},
    {CommandValue::names, ValueRole::list, 1, int32_max},
    {CommandValue::watched_names, ValueRole::list, 1, int32_max, 0},
    {CommandValue::rate, ValueRole::value, 0, state_rate_max_hz},
    {CommandValue::key, ValueRole::text, 1, int32_max},
    {CommandValue::setting, ValueRole::text2, 1, int32_max},
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

  Text word;  // the first value, if the letter alone does not name the kind: "STOP"
  CommandKind kind;
  char letter;
  CommandEffect effect;
  std::uint8_t channels;   // 0: none
  std::uint8_t least = 0;  // number of values, without the word
  std::uint8_t most = 0;
  CommandValue values[5] = {};  // those after the word; at most one is optional
};

namespace short_names {
using K = CommandKind;
using E = CommandEffect;
using V = CommandValue;
constexpr CommandRow command_rows[] = {
    {K::osmc, 'O', {}, E::output, osmc_channels, {V::pwm, V::direction, V::channel}},
    {K::dhb12, 'D', {}, E::output, dhb12_channels, {V::pwm, V::direction, V::channel}},
    {K::servo, 'S', {}, E::output, servo_channels, {V::pulse, V::channel}},
    {K::relay, 'R', {}, E::output, relay_channels, {V::channel, V::on_off}},
    {K::stepper, 'P', {}, E::output, stepper_channels, {V::position, V::step_rate, V::channel}},
    {K::zero, 'Z', {}, E::output, encoder_channels, {V::channel}},
    {K::bldc,
     'B',
     {},
     E::output,
     bldc_channels,
     {V::motor_speed, V::direction, V::brake, V::channel}},
    {K::dac, 'X', "DAC", E::output, dac_channels, {V::device_channel, V::millivolts}},
    {K::i2c_write, 'X', "WRITE", E::device, 0, {V::address, V::written_bytes, V::answer_count}},
    {K::uart_write, 'X', "UART", E::device, uart_channels, {V::uart, V::sent_bytes}},
    {K::i2c_read, 'X', "READ", E::none, 0, {V::address, V::register_bytes, V::count}},
    {K::i2c_scan, 'X', "SCAN", E::none, 0, {}},
    {K::i2c_poll,
     'X',
     "POLL",
     E::none,
     i2c_slots,
     {V::address, V::register_bytes, V::count, V::period, V::slot}},
    {K::i2c_poll_off, 'X', "OFF", E::none, i2c_slots, {V::slot}},
    {K::proximity, 'U', {}, E::none, ultrasonic_channels, {V::threshold, V::channel}},
    {K::heartbeat, 'H', host_heartbeat_word, E::none, 0, {}},
    {K::stop, 'E', "STOP", E::none, 0, {}},
    {K::clear, 'E', "CLEAR", E::none, 0, {V::cause}},
    {K::leave, 'E', "LEAVE", E::none, 0, {}},
    {K::fields, 'F', {}, E::none, 0, {V::names}},
    {K::setting, 'C', {}, E::none, 0, {V::key, V::setting}},
    {K::identify, 'Q', "ID", E::none, 0, {}},
    {K::watch, 'W', {}, E::none, 0, {V::rate, V::watched_names}},
};
}  // namespace short_names
using short_names::command_rows;
constexpr const CommandRow& row_of(CommandKind kind) {
  return command_rows[static_cast<std::size_t>(kind)];
}

constexpr bool has_a_row_of_each() {
  for (std::size_t i = 0; i < command_kinds; ++i) {
    if (static_cast<std::size_t>(command_rows[i].kind) != i) return false;
  }
  for (std::size_t i = 0; i < command_values; ++i) {
    if (static_cast<std::size_t>(value_rows[i].value) != i) return false;
  }
  return sizeof command_rows / sizeof *command_rows == command_kinds &&
         sizeof value_rows / sizeof *value_rows == command_values;
}
// True if a value fits into its member of Command.
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
static_assert(has_a_row_of_each(), "the rows stand in the order of their enum");
static_assert(encoder_channels == stepper_channels, "Z sets both");

// A bit for each kind that moves at least so much, so that asking needs no table at run time.
constexpr std::uint32_t kinds_that_move(CommandEffect least) {
  std::uint32_t kinds = 0;
  for (const CommandRow& row : command_rows) {
    if (row.effect >= least) kinds |= std::uint32_t{1} << static_cast<unsigned>(row.kind);
  }
  return kinds;
}
// True if the command may be part of a group.
constexpr bool joins_groups(CommandKind kind) {
  constexpr std::uint32_t kinds = kinds_that_move(CommandEffect::output);
  return (kinds >> static_cast<unsigned>(kind) & 1U) != 0;
}
// True if the command may move something: an output, or an actuator on a bus or UART of the user's.
// Such commands are refused in the safe state.
constexpr bool drives_output(CommandKind kind) {
  constexpr std::uint32_t kinds = kinds_that_move(CommandEffect::device);
  return (kinds >> static_cast<unsigned>(kind) & 1U) != 0;
}

}  // namespace r4
