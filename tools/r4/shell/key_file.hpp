// SPDX-License-Identifier: GPL-3.0-or-later
// The file with a board's key (load_key() reads it), for its owner alone: how it is made and named.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cli_fwd.hpp"
#include "r4link/options.hpp"

namespace r4::tool {

// Makes a file with a new random key. Throws Error: open if it cannot be made; one that is there is
// never overwritten.
void make_key_file(const std::string& path, std::uint8_t id);

// --key FILE, or R4_KEY in the environment, for a command that opens a board.
CLI::Option* add_key(CLI::App& command, std::string& path);
// The same, of which a command takes several.
CLI::Option* add_keys(CLI::App& command, std::vector<std::string>& paths);

// The options of a session with the key of that file; without one if `path` is empty.
BoardOptions with_key(const std::string& path, BoardOptions options = {});

}  // namespace r4::tool
