// SPDX-License-Identifier: GPL-3.0-or-later
// Commands as fields of a datagram (paper section 4.2; docs/reference/protocol.md), for both ends.
#pragma once

#include <cstdint>

#include "r4link/command.hpp"
#include "r4link/datagram.hpp"
#include "r4link/messages/datagram_writer.hpp"
#include "r4link/state.hpp"

namespace r4 {

// True if E:STOP is among the fields: a stop is obeyed even among other fields.
bool asks_to_stop(const Datagram& datagram);

// The number for confirming a stop: its field STOP, else its PNum. False if the stop has neither.
constexpr Text stop_number_name("STOP");
bool stop_number(const Datagram& datagram, std::uint32_t& out);

// Reads a command field. Faults in this order: Refusal::unknown (no such letter or word), ::format
// (wrong number of values, an empty value, not a whole number), ::channel, ::range (also too large
// for any type). `out` is written only on Refusal::none; its texts are views of `field`.
// settings.hpp checks ranges of settings, and parse_fields() checks names of fields.
Refusal parse_command(const Field& field, Command& out);
// Reads a command of the kind `row` from its values: `texts`, without the letter or word.
Refusal read_values(const CommandRow& row, const Text* texts, std::size_t count, Command& out);

// Appends the command's field: "O:358,1,1;".
void write_command(DatagramWriter& writer, const Command& command);

}  // namespace r4
