// SPDX-License-Identifier: GPL-3.0-or-later
// Does the board's state show that a command took effect? For boards that do not report CMD.
#pragma once

#include "r4link/command.hpp"
#include "r4link/state.hpp"

namespace r4 {

// True if `state`, as one datagram carried it, shows the value that `command` sets. Commands that
// no state field shows (threshold, fields, settings) are never shown.
bool state_shows(const State& state, const Command& command);

}  // namespace r4
