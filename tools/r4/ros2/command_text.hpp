// SPDX-License-Identifier: GPL-3.0-or-later
// R4_Command (paper section 8.8): board commands as text, separated by semicolons.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "r4link/commands/command_text.hpp"
#include "r4link/link.hpp"

namespace r4::tool::ros2 {

// Empty if the string has no NUL at its end, a NUL within, or more bytes than a datagram.
std::optional<std::string> text_of(std::string_view bytes);

// True if the text contains E:STOP, which is obeyed whatever else the text contains.
bool asks_to_stop(std::string_view text);

// Throws Error{usage} naming the first command that is wrong or not allowed from a topic: settings,
// choices of fields, heartbeats, farewells. A text that is not ASCII is not quoted.
std::vector<OwnCommand> commands_of(std::string_view text);

// Replaces the library's advice to use a library call or r4 send, which the board refuses while
// this bridge controls it. A cause older than this program is cleared by a service.
Problem for_a_node(Problem problem, DisarmCause cause);

}  // namespace r4::tool::ros2
