// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/commands/command_text.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>

#include "../../protocol/messages/command_field.hpp"
#include "../../protocol/messages/settings.hpp"
#include "command_help.hpp"
#include "r4link/error.hpp"

namespace r4 {

namespace {

std::string_view without_last_semicolon(std::string_view text) {
  return text.substr(0, text.size() - (text.ends_with(';') ? 1 : 0));
}

// The command's texts are views of `text`.
Command parsed(std::string_view text) {
  const std::string_view trimmed = without_last_semicolon(text);
  const auto colon = trimmed.find(':');
  if (colon == std::string_view::npos) throw Error(bad_command(trimmed, Refusal::format));
  const Field field(Text(trimmed.substr(0, colon)), Text(trimmed.substr(colon + 1)));
  Command command;
  Refusal refusal = parse_command(field, command);
  if (refusal == Refusal::none && command.kind == CommandKind::fields) {
    FieldSet set;
    refusal = parse_fields(command.text, set);
  }
  if (refusal == Refusal::none && command.kind == CommandKind::setting) {
    Settings settings;  // the board's settings are unknown, so these leave each key its whole range
    settings.heartbeat_ms = 50;
    settings.timeout_ms = 10000;
    refusal = set(settings, command.text, command.text2);
  }
  if (refusal != Refusal::none) throw Error(bad_command(trimmed, refusal));
  // A text may hold bytes that the grammar forbids. Such a command cannot be written.
  if (to_text(command).empty()) throw Error(bad_command(trimmed, Refusal::format));
  return command;
}

std::string words(Text text) { return printable(std::string_view(text.data(), text.size())); }

// "OSMC 1 forward, duty 0.087"
std::string drive_words(std::string_view driver, const Command& command) {
  const double duty = std::round(1000.0 * command.value / pwm_max) / 1000;
  return fmt::format("{} {} {}, duty {:g}{}", driver, command.channel,
                     command.direction == Direction::forward ? "forward" : "reverse", duty,
                     command.on ? ", brake on" : "");
}

// "setting rate 50"
std::string setting_words(const Command& command) {
  std::string text = shown(command);
  text.replace(0, 2, "setting ");
  if (const std::size_t comma = text.find(','); comma != std::string::npos) text[comma] = ' ';
  return text;
}

std::string byte_words(int count) { return fmt::format("{} byte{}", count, count == 1 ? "" : "s"); }

// "read 14 bytes at x3B of I2C device 0x68"
std::string read_words(const Command& command) {
  const std::string at = command.text == Text("x") ? "" : " at " + words(command.text);
  return fmt::format("read {}{} of I2C device {:#04x}", byte_words(command.count), at,
                     command.value);
}

}  // namespace

OwnCommand parse_command_text(std::string_view text) { return OwnCommand(parsed(text)); }

bool is_group_text(std::string_view text) {
  return without_last_semicolon(text).find(';') != std::string_view::npos;
}

Setpoints parse_group_text(std::string_view text) {
  text = without_last_semicolon(text);
  Setpoints group;
  for (;;) {
    const std::size_t end = text.find(';');
    group.add(parsed(text.substr(0, end)));
    if (end == std::string_view::npos) return group;
    text.remove_prefix(end + 1);
  }
}

std::string to_text(const Command& command) {
  std::array<char, max_datagram> buffer;
  DatagramWriter writer(buffer.data(), buffer.size());
  write_command(writer, command);
  const std::string_view field(buffer.data(), writer.ok() ? writer.size() : 0);
  return std::string(field.substr(0, field.find_last_of(';')));
}

std::string to_text(const Setpoints& group) {
  std::string text;
  for (std::size_t i = 0; i < group.size(); ++i) {
    if (i != 0) text += ';';
    text += to_text(group[i]);
  }
  return text;
}

std::string shown(std::string_view text) {
  const Text secret = secret_in(text);
  if (secret.empty()) return printable(text);
  const auto before = static_cast<std::size_t>(secret.begin() - text.data());
  return printable(text.substr(0, before)) + "...";
}

std::string shown(const Command& command) { return shown(to_text(command)); }

std::string describe(const Command& command) {
  const int channel = command.channel;
  const std::int32_t value = command.value;
  switch (command.kind) {
    case CommandKind::osmc:
      return drive_words("OSMC", command);
    case CommandKind::dhb12:
      return drive_words("DHB12", command);
    case CommandKind::bldc:
      return drive_words("BLDC", command);
    case CommandKind::servo:
      return value == 0 ? fmt::format("servo {} off", channel)
                        : fmt::format("servo {} at {} us", channel, value);
    case CommandKind::relay:
      return fmt::format("relay {} {}", channel, command.on ? "on" : "off");
    case CommandKind::stepper:
      return fmt::format("stepper {} to {} steps at {} steps/s", channel, value, command.speed);
    case CommandKind::zero:
      return fmt::format("encoder and stepper {} to zero", channel);
    case CommandKind::dac:
      return fmt::format("DAC {} at {} mV", channel, value);
    case CommandKind::i2c_write: {
      const std::string then = command.count == 0 ? "" : ", then read " + byte_words(command.count);
      return fmt::format("write {} to I2C device {:#04x}{}", words(command.text), value, then);
    }
    case CommandKind::uart_write:
      return fmt::format("write {} to UART {}", words(command.text), channel);
    case CommandKind::i2c_read:
      return read_words(command);
    case CommandKind::i2c_scan:
      return "scan the user I2C bus";
    case CommandKind::i2c_poll:
      if (command.count == 0) return fmt::format("reading {} off", channel);
      return fmt::format("reading {}: {} every {} ms", channel, read_words(command),
                         command.period_ms);
    case CommandKind::proximity:
      return value == 0 ? fmt::format("proximity sensor {} off", channel)
                        : fmt::format("proximity sensor {} below {} cm", channel, value);
    case CommandKind::heartbeat:
      return "host heartbeat";
    case CommandKind::stop:
      return "stop every output";
    case CommandKind::clear:
      return value == Command::unnamed_cause ? "clear the safe state"
                                             : fmt::format("clear cause {}", value);
    case CommandKind::leave:
      return "end control";
    case CommandKind::fields:
      return "send fields " + words(command.text);
    case CommandKind::setting:
      return setting_words(command);
    case CommandKind::identify:
      return "ask who the board is";
    case CommandKind::watch:
      if (value == 0) return "stop watching";
      return fmt::format("watch at {} Hz{}{}", value, command.text.empty() ? "" : ", fields ",
                         words(command.text));
  }
  return "unknown command";
}

}  // namespace r4
