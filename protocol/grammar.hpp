// SPDX-License-Identifier: GPL-3.0-or-later
// Which bytes the names and values of a datagram may hold (the grammar is in datagram.hpp). The
// reader and the writer ask here, so that they cannot disagree.
#pragma once

namespace r4 {

// The first byte in [at, end) that no name may hold; `end` if there is none.
const char* skip_name(const char* at, const char* end);
// The same for a value, and for values with the commas between them.
const char* skip_value(const char* at, const char* end);
const char* skip_values(const char* at, const char* end);

}  // namespace r4
