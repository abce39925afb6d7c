// SPDX-License-Identifier: GPL-3.0-or-later
// The errors for wrong and refused commands, with what to do instead.
#pragma once

#include <string>
#include <string_view>

#include "../../protocol/keys/authentication.hpp"
#include "../../protocol/messages/settings.hpp"
#include "r4link/command.hpp"
#include "r4link/error.hpp"
#include "r4link/setpoints.hpp"

namespace r4 {

// The problem of a text that is not a valid command.
Problem bad_command(std::string_view text, Refusal refusal);
// The problem of a command whose values are wrong.
Problem bad_command(const Command& command, Refusal refusal);

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

}  // namespace r4
