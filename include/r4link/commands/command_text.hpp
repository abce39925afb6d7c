// SPDX-License-Identifier: GPL-3.0-or-later
// Commands as the text that a board reads (docs/reference/protocol.md): parsed, written, described.
//     const r4::OwnCommand command = r4::parse_command_text("O:358,1,1");
//     r4::to_text(command);   // "O:358,1,1"
//     r4::describe(command);  // "OSMC 1 forward, duty 0.087"
//
// to_text() writes the secret of a command (a key, a password); shown() and describe() do not.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <variant>

#include "../command.hpp"
#include "../config.hpp"
#include "../setpoints.hpp"
#include "../vocabulary.hpp"

namespace r4 {

// A command that owns its texts. The texts of a `Command` are views.
class OwnCommand {
 public:
  OwnCommand() = default;
  explicit OwnCommand(const Command& command)
      : command_(command),
        text_(command.text.data(), command.text.size()),
        text2_(command.text2.data(), command.text2.size()) {}

  // The texts of the result are views of this object.
  operator Command() const& {  // NOLINT(google-explicit-constructor)
    Command command = command_;
    command.text = text_;
    command.text2 = text2_;
    return command;
  }
  operator Command() const&& = delete;  // NOLINT(google-explicit-constructor)

 private:
  Command command_;
  std::string text_, text2_;
};

// Parses "O:358,1,1", with or without a final ';'. Throws Error{usage} with the fault.
R4LINK_API OwnCommand parse_command_text(std::string_view text);

using CommandOrGroup = std::variant<OwnCommand, Setpoints>;
// Parses "O:358,1,1", or a group, "O:358,1,1;O:358,1,2". Throws Error{usage} with the fault.
R4LINK_API CommandOrGroup parse_text(std::string_view text);

// "O:358,1,1". Empty if a text of the command has bytes that a datagram cannot hold.
R4LINK_API std::string to_text(const Command& command);
// "O:358,1,1;O:358,1,2".
R4LINK_API std::string to_text(const Setpoints& group);

// The text for people and logs: printable(), and without a secret: "C:password,...", "C:key,1:...".
R4LINK_API std::string shown(const Command& command);
R4LINK_API std::string shown(const Setpoints& group);
R4LINK_API std::string shown(std::string_view text);

// The command in words, with units and without a secret: "servo 3 at 1500 us", "relay 1 on".
R4LINK_API std::string describe(const Command& command);

// Throws Error{usage} unless every path of `url` is a board's own cable. On other transports, other
// programs would see the secret, and boards refuse it. `secret`: the name of the secret.
R4LINK_API void require_cable(std::string_view url, std::string_view secret);
// If the command holds a secret, checks `url`. Board and AsyncBoard call this before they send.
R4LINK_API void require_cable(std::string_view url, const Command& command);

// The meaning of a board's refusal: "no such channel".
R4LINK_API std::string_view meaning_of(Refusal refusal);

// "OSMC", "servo".
R4LINK_API std::string_view name_of(CommandKind kind);

// The help for a kind of command, also for the fix in an error.
struct CommandHelp {
  CommandKind kind = CommandKind::heartbeat;
  std::string form;          // "O:pwm,dir,ch"
  std::string_view meaning;  // "OSMC motor driver"
  std::string ranges;        // "pwm 0-4095, dir 0 or 1, ch 1-4"
};
R4LINK_API const CommandHelp& command_help(CommandKind kind);
// All kinds, in the order of CommandKind.
R4LINK_API std::span<const CommandHelp> all_command_help();

}  // namespace r4
