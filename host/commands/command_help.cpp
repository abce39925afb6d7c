// SPDX-License-Identifier: GPL-3.0-or-later
#include "command_help.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "../../protocol/messages/command_field.hpp"
#include "command_words.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/discovery/url_pattern.hpp"

namespace r4 {

namespace {

// The key in "C:key,value". Without a comma it ends at a space, colon or equals sign.
std::string_view key_in(std::string_view text) {
  const std::string_view key = text.substr(2);
  return key.substr(0, key.find_first_of(", :="));
}

std::string setting_fix(std::string_view key) {
  if (const FoundSetting found = find_setting(Text(key)); found.row != nullptr) {
    return "write " + std::string(key) + ",value with " + values_of(found.row->setting);
  }
  std::string fix = "write key,value with a key of";
  for (const SettingRow& row : setting_rows)
    fix += " " + std::string(row.key.begin(), row.key.end());
  return fix + " …";
}

std::string form_with_ranges(const CommandHelp& command) {
  return command.form + (command.ranges.empty() ? "" : " with " + command.ranges);
}

// The forms of the command at the start of `text`, or of all commands with the same letter.
std::string forms_like(std::string_view text) {
  std::string forms;
  if (text.empty() || (text.size() > 1 && text[1] != ':')) return forms;
  const std::string_view values = text.substr(std::min<std::size_t>(2, text.size()));
  for (const CommandHelp& each : all_command_help()) {
    const CommandRow& row = row_of(each.kind);
    if (row.letter != text.front()) continue;
    if (row.word.empty() || row.word == Text(values.substr(0, values.find(',')))) {
      return form_with_ranges(each);
    }
    forms += (forms.empty() ? "" : ", ") + each.form;
  }
  return forms;
}

}  // namespace

std::string_view meaning_of(Refusal refusal) {
  switch (refusal) {
    case Refusal::none:
      return "not refused";
    case Refusal::unknown:
      return "the board knows no such command, field or setting";
    case Refusal::format:
      return "not the form of this command";
    case Refusal::range:
      return "a value is outside its range";
    case Refusal::channel:
      return "no such channel";
    case Refusal::stale:
      return "overtaken by newer commands or delayed too long";
    case Refusal::duplicate:
      return "executed before";
    case Refusal::safe:
      return "the board is in its safe state";
    case Refusal::busy:
      return "another host controls the board";
    case Refusal::auth:
      return "not signed with the board's key, or only to be set over USB";
    case Refusal::full:
      return "another transfer is under way";
  }
  return "unknown code";
}

Problem bad_command(std::string_view text, Refusal refusal) {
  Problem problem{ErrorKind::usage, shown(text), std::string(meaning_of(refusal)), ""};
  if (text.starts_with("C:")) {
    problem.fix = setting_fix(key_in(text));
  } else if (const std::string forms = forms_like(text); !forms.empty()) {
    problem.fix = "use " + forms;
  } else {
    problem.reason = "no such command";
    problem.fix = "the commands are";
    for (const CommandHelp& each : all_command_help()) problem.fix += " " + each.form;
  }
  return problem;
}

Problem bad_command(const Command& command, Refusal refusal) {
  return {ErrorKind::usage, shown(command), std::string(meaning_of(refusal)),
          command.kind == CommandKind::setting
              ? setting_fix({command.text.data(), command.text.size()})
              : "use " + form_with_ranges(command_help(command.kind))};
}

Problem failed_transfer(std::string_view command, I2cOutcome outcome) {
  Problem problem{ErrorKind::refused, std::string(command), to_text(outcome), ""};
  switch (outcome) {
    case I2cOutcome::no_acknowledge:
      problem.fix = "X:SCAN shows which addresses answer; look at supply, wires and pull-ups";
      break;
    case I2cOutcome::bus_stuck:
      problem.fix =
          "a device holds SDA or SCL of the user's bus: look at its supply, or take it off";
      break;
    default:
      problem.fix = "send it again when the board is ACTIVE";
      break;
  }
  return problem;
}

void require_valid(const Command& command) {
  if (const Refusal refusal = check_command(command); refusal != Refusal::none) {
    throw Error(bad_command(command, refusal));
  }
  if (command.kind == CommandKind::leave) {
    throw Error(ErrorKind::usage, "E:LEAVE",
                "a host says it when it ends, and sends nothing after it",
                "close the board, or end the program that has it");
  }
  if (command.kind != CommandKind::fields && command.kind != CommandKind::setting) return;
  std::array<char, max_datagram - DatagramWriter::trailer_max - signature_max> buffer;
  DatagramWriter writer(buffer.data(), buffer.size());
  write_command(writer, command);
  if (!writer.ok()) {
    throw Error(ErrorKind::usage, command.kind == CommandKind::fields ? "F" : "C",
                "its text is too long for one datagram, or has bytes that a datagram cannot hold",
                "use printable ASCII without ; and ^, at most 900 characters");
  }
}

void require_any(const Setpoints& group) {
  if (!group.empty()) return;
  throw Error(ErrorKind::usage, "the group", "has no command", "add one: Setpoints::add()");
}

void require_cable(std::string_view url, std::string_view secret) {
  for (const std::string& path : split_paths(url)) {
    const bool own =
        path.starts_with("serial:") || path.starts_with("sim:") || path.starts_with("memory:");
    if (own) continue;
    throw Error(ErrorKind::usage, std::string(secret),
                fmt::format("a board takes it over USB only, and at {} others would see it", path),
                "use serial:auto");
  }
}

void require_cable(std::string_view url, const Command& command) {
  if (command.kind == CommandKind::setting && is_secret_setting(command.text)) {
    require_cable(url, shown(command));
  }
}

}  // namespace r4
