// SPDX-License-Identifier: GPL-3.0-or-later
// Commands as fields of a datagram (paper section 4.2; docs/protocol.md).
//
// The same parser serves the board, the host's `r4 send` text and the tests, so what one side sends
// the other side takes.
#pragma once

#include <cstdint>

#include "r4link/command.hpp"
#include "r4link/datagram.hpp"
#include "r4link/messages/datagram_writer.hpp"
#include "r4link/state.hpp"

namespace r4 {

// Is there E:STOP among its fields? A stop is obeyed whatever else is in its datagram.
bool asks_to_stop(const Datagram& datagram);

// By what number does a stop ask to be confirmed? Its field STOP, else its PNum. False: by none.
constexpr Text stop_number_name("STOP");
bool stop_number(const Datagram& datagram, std::uint32_t& out);

// Reads a command field. Refusal::unknown (no such letter or word), ::format (number of values, an
// empty one, not a whole number), ::channel, ::range (also a number too large for any type), in
// this order; `out` is only written on Refusal::none. Its texts are views of `field`. Ranges of
// settings and names of fields are checked by settings.hpp and parse_fields.
Refusal parse_command(const Field& field, Command& out);
// The same for a command of that row, given as its values without the word.
Refusal read_values(const CommandRow& row, const Text* texts, std::size_t count, Command& out);

// Appends the command's field: "O:358,1,1;".
void write_command(DatagramWriter& writer, const Command& command);

}  // namespace r4
