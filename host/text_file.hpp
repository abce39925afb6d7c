// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <string>

namespace r4 {

// The first `most` + 1 bytes of a file, so that a parser can reject a longer or endless file.
// Throws Error{open}, or Error{permission}, with `fix`.
std::string read_text_file(const std::string& path, std::size_t most, const char* fix);

}  // namespace r4
