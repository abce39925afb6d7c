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

// The key in "C:key,value". In a wrong text, a space, colon or equals sign also ends it.
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
      return "the board does not know this command, field or setting";
    case Refusal::format:
      return "the text does not have the form of this command";
    case Refusal::range:
      return "a value is outside its range";
    case Refusal::channel:
      return "the channel does not exist";
    case Refusal::stale:
      return "the command is older than an executed one, or was delayed too long";
    case Refusal::duplicate:
      return "the command was executed before";
    case Refusal::safe:
      return "the board is in its safe state";
    case Refusal::busy:
      return "another host controls the board";
    case Refusal::auth:
      return "the command is not signed with the board's key, or is accepted over USB only";
    case Refusal::full:
      return "no room, or another transfer is under way";
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
    problem.reason = "this is not a command";
    problem.fix = "use one of";
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
      problem.fix = "send X:SCAN to see which addresses answer; check supply, wires and pull-ups";
      break;
    case I2cOutcome::bus_stuck:
      problem.fix =
          "find the device that holds SDA or SCL of the user's bus: check its supply, or remove it";
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
    throw Error(ErrorKind::usage, "E:LEAVE", "a host sends this only when it ends its session",
                "close the board, or end the program that controls it");
  }
  if (command.kind != CommandKind::fields && command.kind != CommandKind::setting) return;
  std::array<char, max_datagram - DatagramWriter::trailer_max - signature_max> buffer;
  DatagramWriter writer(buffer.data(), buffer.size());
  write_command(writer, command);
  if (!writer.ok()) {
    throw Error(ErrorKind::usage, command.kind == CommandKind::fields ? "F" : "C",
                "the text is too long for one datagram, or has bytes that a datagram cannot hold",
                "use printable ASCII without ; and ^, at most 900 characters");
  }
}

void require_any(const Setpoints& group) {
  if (!group.empty()) return;
  throw Error(ErrorKind::usage, "the group", "has no command", "add a command: Setpoints::add()");
}

void require_cable(std::string_view url, std::string_view secret) {
  for (const std::string& path : split_paths(url)) {
    const bool own =
        path.starts_with("serial:") || path.starts_with("sim:") || path.starts_with("memory:");
    if (own) continue;
    throw Error(
        ErrorKind::usage, std::string(secret),
        fmt::format("a board accepts this over USB only, and at {} other programs could read it",
                    path),
        "use serial:auto");
  }
}

void require_cable(std::string_view url, const Command& command) {
  if (command.kind == CommandKind::setting && is_secret_setting(command.text)) {
    require_cable(url, shown(command));
  }
}

}  // namespace r4
