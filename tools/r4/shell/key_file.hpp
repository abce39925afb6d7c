// SPDX-License-Identifier: GPL-3.0-or-later
// The key file of a board, readable by its owner only. load_key() reads it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cli_fwd.hpp"
#include "r4link/options.hpp"

namespace r4::tool {

// Creates a file with a new random key. Never overwrites a file. Throws Error{open} on failure.
void make_key_file(const std::string& path, std::uint8_t id);

// --key FILE, or R4_KEY in the environment.
CLI::Option* add_key(CLI::App& command, std::string& path);
CLI::Option* add_keys(CLI::App& command, std::vector<std::string>& paths);

// Sets the key from the file at `path`; an empty `path` means no key.
BoardOptions with_key(const std::string& path, BoardOptions options = {});

}  // namespace r4::tool
