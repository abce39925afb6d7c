// SPDX-License-Identifier: GPL-3.0-or-later
// The limits of a recording as they are written on a command line.
#pragma once

#include <cstdint>
#include <string>

#include "r4link/recording.hpp"

namespace r4::tool {

// Takes --rotate's value into the options: a size such as 500K, 100M or 2G (a thousand bytes each step), or a time
// such as 30s, 10min or 1h. Throws Error{usage}.
void take_rotation(const std::string& text, RecordingOptions& out);

// A size as above. Throws Error{usage}, about `option`.
std::uint64_t read_size(const std::string& option, const std::string& text);

}  // namespace r4::tool
