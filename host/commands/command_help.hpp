// SPDX-License-Identifier: GPL-3.0-or-later
// The errors for wrong and refused commands, with a fix.
#pragma once

#include <string>
#include <string_view>

#include "../../protocol/keys/authentication.hpp"
#include "../../protocol/messages/settings.hpp"
#include "r4link/command.hpp"
#include "r4link/error.hpp"
#include "r4link/setpoints.hpp"

namespace r4 {

Problem bad_command(std::string_view text, Refusal refusal);
Problem bad_command(const Command& command, Refusal refusal);

// Throws Error{usage} for values out of range, and for texts that are too long for a datagram.
void require_valid(const Command& command);

// Why a transfer on the user's bus failed. The board has executed the command.
Problem failed_transfer(std::string_view command, I2cOutcome outcome);
// Throws Error{usage} for an empty group. Setpoints holds only valid commands.
void require_any(const Setpoints& group);

}  // namespace r4
