// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>

#include "r4link/recording.hpp"

namespace r4::tool {

// Parses --rotate: 500K, 100M, 2G (powers of 1000) or 30s, 10min, 1h. Throws Error{usage}.
void take_rotation(const std::string& text, RecordingOptions& out);

// Parses a size such as 500K. Throws Error{usage} that names `option`.
std::uint64_t read_size(const std::string& option, const std::string& text);

}  // namespace r4::tool
