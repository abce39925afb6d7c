// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <functional>
#include <string>

#include "formats.hpp"

namespace r4::tool {

// "-" is standard input. `advance` gets the number of bytes of each read. Throws Error.
void read_file(const std::string& path, RecordingVisitor& visitor,
               const SourceOptions& options = {},
               const std::function<void(std::size_t)>& advance = {});

}  // namespace r4::tool
