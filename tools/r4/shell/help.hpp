// SPDX-License-Identifier: GPL-3.0-or-later
// What `r4 --help` says besides the options: first steps, URLs, commands of the board, exit codes.
#pragma once

#include <string>

#include "cli_fwd.hpp"

namespace r4::tool {

// The end of `r4 --help`.
std::string root_footer();

// The URLs that `r4` takes, one a line, from the registry of transports.
std::string url_table();
// Prints the same as JSON, {"type":"scheme"…} each.
void print_url_schemes();

// The board's commands with their ranges, one a line.
std::string command_table();

// How the help of `root` and its subcommands is set out.
void set_help_layout(CLI::App& root);

// The option or subcommand of `command` whose name is most like `word`; empty if none is near.
std::string nearest_name(const CLI::App& command, const std::string& word);

}  // namespace r4::tool
