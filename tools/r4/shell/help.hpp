// SPDX-License-Identifier: GPL-3.0-or-later
// What `r4 --help` prints besides the options: first steps, URLs, board commands, exit codes.
#pragma once

#include <string>

#include "cli_fwd.hpp"

namespace r4::tool {

std::string root_footer();

// The URL schemes from the registry of transports, one a line.
std::string url_table();
// Prints each URL scheme as JSON: {"type":"scheme"…}.
void print_url_schemes();

// The board commands with their ranges, one a line.
std::string command_table();

void set_help_layout(CLI::App& root);

// The option or subcommand of `command` with the name closest to `word`; empty if none is close.
std::string nearest_name(const CLI::App& command, const std::string& word);

}  // namespace r4::tool
