// SPDX-License-Identifier: GPL-3.0-or-later
// The board's state as fields of a datagram (paper section 4.1). Read: r4link/messages/message.hpp.
#pragma once

#include "r4link/datagram.hpp"
#include "r4link/messages/datagram_writer.hpp"
#include "r4link/state.hpp"

namespace r4 {

// Appends one field with its values from `state`.
void write_field(DatagramWriter& writer, StateField field, const State& state);

// The value of SAFE. A number without a meaning here, a newer board's, is a fault. False if it is
// no number.
bool parse_safe_reason(Text text, SafeReason& out);

}  // namespace r4
