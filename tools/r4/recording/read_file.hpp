// SPDX-License-Identifier: GPL-3.0-or-later
// Reading a file of any of the formats.
#pragma once

#include <cstddef>
#include <functional>
#include <string>

#include "formats.hpp"

namespace r4::tool {

// Tells the visitor what is in the file of that name, "-" being the standard input. `advance` is told how many bytes were
// read. Throws Error if it cannot be read, or is of another kind.
void read_file(const std::string& path, RecordingVisitor& visitor,
               const SourceOptions& options = {},
               const std::function<void(std::size_t)>& advance = {});

}  // namespace r4::tool
