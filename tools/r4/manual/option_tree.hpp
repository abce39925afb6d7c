// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "tools/r4/shell/cli_fwd.hpp"

namespace r4::tool {

bool takes_value(const CLI::Option& option);

std::vector<std::string> names_of(const CLI::Option& option);

std::vector<const CLI::Option*> options_of(const CLI::App& command);
std::vector<const CLI::Option*> positionals_of(const CLI::App& command);

// The choices of a value, as words ("bash zsh"); empty for a free value.
std::string choices_of(const CLI::Option& option);

// The fixed starts of URLs: "udp://", "serial:".
std::vector<std::string> url_beginnings();

}  // namespace r4::tool
