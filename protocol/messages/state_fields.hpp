// SPDX-License-Identifier: GPL-3.0-or-later
// The state as fields of a datagram (paper section 4.1). Reading: read_state() of r4link/state.hpp.
#pragma once

#include "r4link/datagram.hpp"
#include "r4link/messages/datagram_writer.hpp"
#include "r4link/state.hpp"

namespace r4 {

void write_field(DatagramWriter& writer, StateField field, const State& state);

// The value of SAFE. An unknown number, from a newer board, is a fault. False if not a number.
bool parse_safe_reason(Text text, SafeReason& out);

}  // namespace r4
