// SPDX-License-Identifier: GPL-3.0-or-later
#include "command_help.hpp"

#include <algorithm>
#include <array>

namespace r4 {

namespace {

constexpr std::array<CommandHelp, 14> table{{
    {'O', "O:pwm,dir,ch", "OSMC motor driver", "pwm 0-4095, dir 0 or 1, ch 1-4"},
    {'D', "D:pwm,dir,ch", "DHB12 motor driver", "pwm 0-4095, dir 0 or 1, ch 1-4"},
    {'S', "S:us,ch", "servo pulse width", "us 0 (off) to 2500, ch 1-16"},
    {'R', "R:ch,On|Off", "relay", "ch 1-8 (1 is the dead-man's-handle relay), On or Off"},
    {'P', "P:pos[,speed],ch", "stepper target", "pos in steps, speed 1-20000 steps/s, ch 1-4"},
    {'Z', "Z:ch", "encoder and stepper position to zero", "ch 1-4"},
    {'B', "B:speed,dir,brake,ch", "brushless motor driver",
     "speed 0-4095, dir 0 or 1, brake 0 or 1, ch 1-4"},
    {'U', "U:cm,ch", "proximity threshold", "cm 0 (off) to 400, ch 1-4"},
    {'E', "E:STOP|CLEAR", "every output safe, until E:CLEAR", "STOP or CLEAR"},
    {'F', "F:name,name…", "which state fields are sent", "DEFAULT, ALL or names such as ENC1"},
    {'C', "C:key,value", "settings",
     "rate 1-1000 Hz, heartbeat 50-1000 ms, timeout 100-10000 ms, recovery last|rearm, pack 0|1 …"},
    {'Q', "Q:ID", "asks who the board is", "ID"},
    {'H', "H:ROS2-R4", "host heartbeat", "ROS2-R4"},
    {0, "", "", ""},
}};

}  // namespace

const CommandHelp* all_command_help() { return table.data(); }

const CommandHelp* command_help(char letter) {
  const auto found = std::find_if(table.begin(), table.end(),
                                  [letter](const CommandHelp& h) { return h.letter == letter; });
  return letter == 0 || found == table.end() ? nullptr : &*found;
}

std::string text_of(const Command& command) {
  std::array<char, max_datagram> buffer;
  DatagramWriter writer(buffer.data(), buffer.size());
  write_command(writer, command);
  const std::string_view field(buffer.data(), writer.ok() ? writer.size() : 0);
  return std::string(field.substr(0, field.find_last_of(';')));
}

std::string shown(const Command& command) {
  if (command.kind != CommandKind::setting || !is_secret_setting(command.text)) {
    return text_of(command);
  }
  const std::string_view value(command.text2.data(), command.text2.size());
  // Of a key, which one it is.
  const std::size_t colon = command.text == key_setting ? value.find(':') + 1 : 0;
  return text_of(Command::setting(command.text, Text(std::string(value.substr(0, colon)) + "...")));
}

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
  }
  return "unknown code";
}

Problem bad_command(std::string_view text, Refusal refusal) {
  Problem problem{ErrorKind::usage, std::string(text), std::string(meaning_of(refusal)), ""};
  const CommandHelp* help = text.empty() ? nullptr : command_help(text.front());
  const bool is_letter = text.size() == 1 || (text.size() > 1 && text[1] == ':');
  if (help != nullptr && is_letter) {
    problem.fix = "use " + std::string(help->form) + " with " + std::string(help->ranges);
  } else {
    problem.reason = "no such command";
    problem.fix = "the commands are";
    for (const CommandHelp& each : table) {
      if (each.letter != 0) problem.fix += " " + std::string(each.form);
    }
  }
  return problem;
}

void require_valid(const Command& command) {
  if (const Refusal refusal = check(command); refusal != Refusal::none) {
    throw Error(bad_command(text_of(command), refusal));
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

Command parse_command_text(std::string_view text) {
  const std::string_view trimmed = text.substr(0, text.size() - (text.ends_with(';') ? 1 : 0));
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
    Settings settings;  // the board's are not known here: those that leave each key its whole range
    settings.heartbeat_ms = 50;
    settings.timeout_ms = 10000;
    refusal = set(settings, command.text, command.text2);
  }
  if (refusal != Refusal::none) throw Error(bad_command(trimmed, refusal));
  // Nothing that the grammar forbids may hide in a text: what cannot be written is not a command.
  if (text_of(command).empty()) throw Error(bad_command(trimmed, Refusal::format));
  return command;
}

}  // namespace r4
