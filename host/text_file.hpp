// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <string>

namespace r4 {

// At most `most` + 1 bytes, to detect a longer file. Throws Error{open}, {permission} with `fix`.
std::string read_text_file(const std::string& path, std::size_t most, const char* fix);

}  // namespace r4
