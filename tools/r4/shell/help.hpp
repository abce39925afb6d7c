// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "cli_fwd.hpp"

namespace r4::tool {

std::string root_footer();

std::string url_table();
void print_url_schemes();

std::string command_table();

void set_help_layout(CLI::App& root);

std::string nearest_name(const CLI::App& command, const std::string& word);

}  // namespace r4::tool
