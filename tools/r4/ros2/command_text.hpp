// SPDX-License-Identifier: GPL-3.0-or-later
// What R4_Command carries (paper section 8.8): a command of the board as text, or several separated by semicolons.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "r4link/command.hpp"

namespace r4::tool::ros2 {

// The text of a string in a sample, of its bytes; none if it is no string: no NUL at its end, one within it, or longer
// than a datagram.
std::optional<std::string> text_of(std::string_view bytes);

// Is there E:STOP in it? It is obeyed whatever else is there.
bool asks_to_stop(std::string_view text);

// Its commands, all of them right; their texts are views of `text`. Throws Error{usage} naming the first that is wrong
// or that cannot come from a topic: settings, choices of fields, heartbeats and farewells. A text that is not ASCII is
// not repeated there.
std::vector<Command> commands_of(std::string_view text);

}  // namespace r4::tool::ros2
