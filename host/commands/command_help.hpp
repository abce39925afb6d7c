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

Problem bad_command(std::string_view text, Refusal refusal);
Problem bad_command(const Command& command, Refusal refusal);

// Throws Error{usage} for values outside their ranges, or texts too long for a datagram.
void require_valid(const Command& command);

// Why a transfer on the user's bus has failed, although the board has executed the command.
Problem failed_transfer(std::string_view command, I2cOutcome outcome);
// Throws Error{usage} for a group without commands. Setpoints holds only valid commands.
void require_any(const Setpoints& group);

}  // namespace r4
