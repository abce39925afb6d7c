// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/commands/command_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "../../protocol/messages/command_field.hpp"
#include "../../protocol/messages/settings.hpp"
#include "command_help.hpp"
#include "command_words.hpp"
#include "r4link/error.hpp"

namespace r4 {

namespace {

std::string_view without_last_semicolon(std::string_view text) {
  return text.substr(0, text.size() - (text.ends_with(';') ? 1 : 0));
}

// The texts of the result are views of `text`.
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
    Settings settings;  // the board's settings are unknown: each key has its whole range
    settings.heartbeat_ms = 50;
    settings.timeout_ms = 10000;
    refusal = set(settings, command.text, command.text2);
  }
  if (refusal != Refusal::none) throw Error(bad_command(trimmed, refusal));
  // Empty if a text holds bytes that the grammar forbids.
  if (to_text(command).empty()) throw Error(bad_command(trimmed, Refusal::format));
  return command;
}

std::string words(Text text) { return printable(std::string_view(text.data(), text.size())); }

// "14 bytes at x3B"
std::string byte_words(int count, Text at = Text()) {
  return fmt::format("{} byte{}{}", count, count == 1 ? "" : "s",
                     at.size() <= 1 ? "" : " at " + words(at));
}

std::string setting_words(const Command& command) {
  std::string text = shown(command);
  text.erase(0, std::min(text.size(), std::string_view("C:").size()));  // empty if not writable
  if (const std::size_t comma = text.find(','); comma != std::string::npos) text[comma] = ' ';
  return text;
}

}  // namespace

OwnCommand parse_command_text(std::string_view text) { return OwnCommand(parsed(text)); }

CommandOrGroup parse_text(std::string_view text) {
  text = without_last_semicolon(text);
  if (text.find(';') == std::string_view::npos) return parse_command_text(text);
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
std::string shown(const Setpoints& group) { return to_text(group); }

std::string describe(const Command& command) {
  const KindWords& of_kind = words_of(command.kind);
  const std::int32_t none = command.kind == CommandKind::clear ? Command::unnamed_cause : 0;
  const bool empty = command.value == none && !of_kind.empty_sentence.empty();
  const std::string text = words(command.text);
  const bool setting = command.kind == CommandKind::setting;
  return fmt::format(
      fmt::runtime(empty ? of_kind.empty_sentence : of_kind.sentence),
      fmt::arg("name", of_kind.name), fmt::arg("ch", command.channel),
      fmt::arg("value", command.value), fmt::arg("speed", command.speed),
      fmt::arg("period", command.period_ms), fmt::arg("on", command.on ? "on" : "off"),
      fmt::arg("direction", command.direction == Direction::forward ? "forward" : "reverse"),
      fmt::arg("duty", std::round(1000.0 * command.value / pwm_max) / 1000),
      fmt::arg("brake", command.on ? ", brake on" : ""), fmt::arg("text", text),
      fmt::arg("fields", text.empty() ? "" : ", fields " + text),
      fmt::arg("bytes", byte_words(command.count, command.text)),
      fmt::arg("answer", command.count == 0 ? "" : ", then read " + byte_words(command.count)),
      fmt::arg("setting", setting ? setting_words(command) : ""));
}

}  // namespace r4
