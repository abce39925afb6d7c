// SPDX-License-Identifier: GPL-3.0-or-later
#include "command_words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "r4link/commands/command_text.hpp"

namespace r4 {
namespace {

constexpr std::string_view drive_sentence = "{name} {ch} {direction}, duty {duty:g}{brake}";

// In the order of CommandKind.
constexpr std::array<KindWords, command_kinds> kind_words{{
    {CommandKind::osmc, "OSMC", "OSMC motor driver", drive_sentence},
    {CommandKind::dhb12, "DHB12", "DHB12 motor driver", drive_sentence},
    {CommandKind::servo, "servo", "servo pulse width", "servo {ch} at {value} us",
     "servo {ch} off"},
    {CommandKind::relay, "relay", "relay (1 is the dead-man's-handle relay)", "relay {ch} {on}"},
    {CommandKind::stepper, "stepper", "stepper target",
     "stepper {ch} to {value} steps at {speed} steps/s"},
    {CommandKind::zero, "encoder and stepper", "encoder and stepper position to zero",
     "encoder and stepper {ch} to zero"},
    {CommandKind::bldc, "BLDC", "brushless motor driver", drive_sentence},
    {CommandKind::dac, "DAC", "voltage of the user's", "DAC {ch} at {value} mV"},
    {CommandKind::i2c_write, "I2C", "write to a device on the user I2C bus",
     "write {text} to I2C device {value:#04x}{answer}"},
    {CommandKind::uart_write, "UART", "send on a UART that C:uart1,115200:8N1 has turned on",
     "write {text} to UART {ch}"},
    {CommandKind::i2c_read, "I2C", "read from a device on the user I2C bus",
     "read {bytes} of I2C device {value:#04x}"},
    {CommandKind::i2c_scan, "I2C", "which addresses of the user I2C bus answer",
     "scan the user I2C bus"},
    {CommandKind::i2c_poll, "reading", "read a device each period, into a slot",
     "reading {ch}: read {bytes} of I2C device {value:#04x} every {period} ms"},
    {CommandKind::i2c_poll_off, "reading", "end the reading of a slot", "reading {ch} off"},
    {CommandKind::proximity, "proximity sensor", "proximity threshold",
     "proximity sensor {ch} below {value} cm", "proximity sensor {ch} off"},
    {CommandKind::heartbeat, "heartbeat", "host heartbeat", "host heartbeat"},
    {CommandKind::stop, "stop", "every output safe, until E:CLEAR", "stop every output"},
    {CommandKind::clear, "clear", "takes the reported cause away", "clear cause {value}",
     "clear the safe state"},
    {CommandKind::leave, "leave", "ends control: every output safe", "end control"},
    {CommandKind::fields, "fields", "which state fields are sent", "send fields {text}"},
    {CommandKind::setting, "setting", "settings", "setting {setting}"},
    {CommandKind::identify, "identify", "asks who the board is", "ask who the board is"},
    {CommandKind::watch, "watch", "streams the state without control",
     "watch at {value} Hz{fields}", "stop watching"},
}};

// What a value is called in a form, and its range: {0} and {1} are the least and the most.
struct ValueWords {
  CommandValue value;
  std::string_view name;
  std::string_view range;
};

// In the order of CommandValue.
constexpr std::array<ValueWords, command_values> value_words{{
    {CommandValue::channel, "ch", "ch {}-{}"},
    {CommandValue::device_channel, "channel", "channel {}-{}"},
    {CommandValue::uart, "uart", "uart {}-{}"},
    {CommandValue::slot, "slot", "slot {}-{}"},
    {CommandValue::pwm, "pwm", "pwm {}-{}"},
    {CommandValue::motor_speed, "speed", "speed {}-{}"},
    {CommandValue::direction, "dir", "dir {} or {}"},
    {CommandValue::brake, "brake", "brake {} or {}"},
    {CommandValue::pulse, "us", "us {} (off) to {}"},
    {CommandValue::on_off, "On|Off", "On or Off"},
    {CommandValue::position, "pos", "pos in steps"},
    {CommandValue::step_rate, "speed", "speed {}-{} steps/s"},
    {CommandValue::threshold, "cm", "cm {} (off) to {}"},
    {CommandValue::millivolts, "mV", "mV {}-{}"},
    {CommandValue::address, "address", "address {0}-{1} or {0:#04x}-{1:#04x}"},
    {CommandValue::register_bytes, "register", "register of {}-{} bytes as x3B00, x is none"},
    {CommandValue::written_bytes, "bytes", "{}-{} bytes as x3B00"},
    {CommandValue::sent_bytes, "bytes", "{}-{} bytes as x3B00"},
    {CommandValue::count, "count", "count {}-{}"},
    {CommandValue::answer_count, "count", "count {}-{}"},
    {CommandValue::period, "period", "period {}-{} ms"},
    {CommandValue::cause, "cause", "cause {}-{}"},
    {CommandValue::names, "name,name…", "DEFAULT, ALL or names such as ENC1"},
    {CommandValue::watched_names, "name,name…", "names as for F"},
    {CommandValue::rate, "rate", "rate {}-{} Hz"},
    {CommandValue::key, "key", ""},
    {CommandValue::setting, "value", ""},
}};

// What a setting takes: {0} and {1} are the least and the most, {2} and {3} a hundredth of them.
struct SettingWords {
  Setting setting;
  std::string_view values;
};

// In the order of Setting.
constexpr std::array<SettingWords, setting_kinds> taken_values{{
    {Setting::rate, "{}-{} states a second"},
    {Setting::heartbeat, "{}-{} ms, below the timeout"},
    {Setting::timeout, "{}-{} ms, above the heartbeat"},
    {Setting::recovery, "last or rearm"},
    {Setting::pack, "{} or {}"},
    {Setting::i2c, "address:register:count:period, such as 0x68:x3B:14:10, or off; up to i2c8"},
    {Setting::uart, "baud:framing, {}-{} and 8N1, 8E1, 8O1 or with 2 stop bits, or off; uart2"},
    {Setting::network, "{}-{} bytes, or off"},
    {Setting::password, "{}-{} bytes, or off"},
    {Setting::host, "an IPv4 address, or off"},
    {Setting::port, "{}-{}"},
    {Setting::node, "{}-{}"},
    {Setting::chips, "{}-{}"},
    {Setting::name, "{}-{} letters, digits, _ and -, or off"},
    {Setting::full_scale, "{2:g}-{3:g} volts; AIN12, AIN5 and the others likewise"},
    {Setting::key, "id:digits, the id {}-{}, then 64 hexadecimal digits; or id:off"},
}};

constexpr bool are_in_order() {
  for (std::size_t i = 0; i < command_kinds; ++i) {
    if (static_cast<std::size_t>(kind_words[i].kind) != i) return false;
  }
  for (std::size_t i = 0; i < command_values; ++i) {
    if (static_cast<std::size_t>(value_words[i].value) != i) return false;
  }
  for (std::size_t i = 0; i < setting_kinds; ++i) {
    if (static_cast<std::size_t>(taken_values[i].setting) != i) return false;
  }
  return true;
}
static_assert(are_in_order(), "each kind, value and setting has its words");

const ValueWords& words_of(CommandValue value) {
  return value_words[static_cast<std::size_t>(value)];
}

// "O:pwm,dir,ch"
std::string form_of(CommandKind kind) {
  const CommandRow& row = row_of(kind);
  std::string form{row.letter, ':'};
  form.append(row.word.data(), row.word.size());
  for (const CommandValue value : row) {
    const std::string_view comma = form.back() == ':' ? "" : ",";
    const std::string name = fmt::format("{}{}", comma, words_of(value).name);
    form += row_of(value).optional ? "[" + name + "]" : name;
  }
  return form;
}

// "pwm 0-4095, dir 0 or 1, ch 1-4"
std::string ranges_of(CommandKind kind) {
  const CommandRow& row = row_of(kind);
  std::string ranges;
  for (const CommandValue value : row) {
    const std::string_view range = words_of(value).range;
    const std::int32_t min = row_of(value).min;
    const bool channel = row_of(value).role == ValueRole::channel;
    const std::int32_t max = channel ? row.channels : row_of(value).max;
    if (range.empty()) continue;
    if (!ranges.empty()) ranges += ", ";
    ranges += fmt::format(fmt::runtime(range), min, max);
  }
  if (kind != CommandKind::setting) return ranges;
  for (const SettingRow& each : setting_rows) {
    ranges +=
        fmt::format("{}{} {}", ranges.empty() ? "" : "; ",
                    std::string_view(each.key.data(), each.key.size()), values_of(each.setting));
  }
  return ranges;
}

}  // namespace

const KindWords& words_of(CommandKind kind) { return kind_words[static_cast<std::size_t>(kind)]; }

std::string values_of(Setting setting) {
  const SettingRow& row = row_of(setting);
  return fmt::format(fmt::runtime(taken_values[static_cast<std::size_t>(setting)].values), row.min,
                     row.max, row.min / 100.0, row.max / 100.0);
}

std::string_view name_of(CommandKind kind) { return words_of(kind).name; }

const CommandHelp& command_help(CommandKind kind) {
  return all_command_help()[static_cast<std::size_t>(kind)];
}

std::span<const CommandHelp> all_command_help() {
  static const auto all = [] {
    std::array<CommandHelp, command_kinds> help;
    for (std::size_t i = 0; i < command_kinds; ++i) {
      const KindWords& each = kind_words[i];
      help[i] = {each.kind, form_of(each.kind), each.meaning, ranges_of(each.kind)};
    }
    return help;
  }();
  return all;
}

}  // namespace r4
