// SPDX-License-Identifier: GPL-3.0-or-later
// Commands in words: their text form, and the errors for wrong and refused commands.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "../../protocol/keys/authentication.hpp"
#include "../../protocol/messages/settings.hpp"
#include "r4link/command.hpp"
#include "r4link/error.hpp"
#include "r4link/setpoints.hpp"

namespace r4 {

// One command of the board, for help and for the fix in an error.
struct CommandHelp {
  char letter;
  std::string_view form;     // "O:pwm,dir,ch"
  std::string_view meaning;  // "OSMC motor driver"
  std::string_view ranges;   // "pwm 0-4095, dir 0 or 1, ch 1-4"
};

// The help of the command with that letter; nullptr if there is none.
const CommandHelp* command_help(char letter);
// All commands, in the order of docs/protocol.md.
std::span<const CommandHelp> all_command_help();

// The text of a command, as it is on the wire: "O:358,1,1".
std::string text_of(const Command& command);
// "O:358,1,1;O:358,1,2"
std::string text_of(const Setpoints& group);

// The same for people and logs: printable(), and without the secret that secret_in() finds:
// "C:password,...", "C:key,1:...".
std::string shown(const Command& command);
std::string shown(std::string_view text);

// Parses "O:358,1,1" (with or without the final ';'). Throws Error{usage} that names the fault. The
// command's texts are views of `text`.
Command parse_command_text(std::string_view text);

// True for several commands, separated by semicolons: "O:358,1,1;O:358,1,2".
bool is_group_text(std::string_view text);
// Throws Error{usage} that names the command that is wrong, or cannot be in a group.
Setpoints parse_group_text(std::string_view text);
// The `at`th command of such a text, from 1; the whole text if it has no such command.
std::string_view part_of(std::string_view text, std::size_t at);

// The problem of a command, given as text, whose form or values are refused before it is sent.
Problem bad_command(std::string_view text, Refusal refusal);

// Throws Error{usage} for a command that cannot be sent: outside its ranges, or with texts that do
// not fit into a datagram.
void require_valid(const Command& command);

// Why a transfer on the user's bus has failed. The board has executed the command.
Problem failed_transfer(std::string_view command, I2cOutcome outcome);
// Throws Error{usage} for a group without commands. Setpoints holds only valid commands.
void require_any(const Setpoints& group);

// Throws Error{usage} unless every path of `url` is a board's own cable. On a network or a bus
// others would see the secret, and the board does not take it there. `secret`: its name for the
// error.
void require_cable(std::string_view url, std::string_view secret);
// The same for a command with a secret. Other commands may go anywhere.
void require_cable(std::string_view url, const Command& command);

// What a board's refusal means: "no such channel".
std::string_view meaning_of(Refusal refusal);

}  // namespace r4
