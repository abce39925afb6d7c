// SPDX-License-Identifier: GPL-3.0-or-later
// What R4_Command carries (paper section 8.8): a command of the board as text, or several separated by semicolons.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "r4link/commands/command_text.hpp"
#include "r4link/link.hpp"

namespace r4::tool::ros2 {

// The text of a string in a sample, of its bytes; none if it is no string: no NUL at its end, one within it, or longer
// than a datagram.
std::optional<std::string> text_of(std::string_view bytes);

// Is there E:STOP in it? It is obeyed whatever else is there.
bool asks_to_stop(std::string_view text);

// Its commands, all of them right. Throws Error{usage} naming the first that is wrong
// or that cannot come from a topic: settings, choices of fields, heartbeats and farewells. A text that is not ASCII is
// not repeated there.
std::vector<OwnCommand> commands_of(std::string_view text);

// `problem` is the library's, which names its own call and r4 send. The board refuses those while
// this bridge controls it, so a cause that came before this program is cleared by a service.
Problem for_a_node(Problem problem, DisarmCause cause);

}  // namespace r4::tool::ros2
