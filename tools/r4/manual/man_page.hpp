// SPDX-License-Identifier: GPL-3.0-or-later
// A manual page of section 1, in troff with the macros of man(7).
#pragma once

#include <string>

#include "tools/r4/shell/cli_fwd.hpp"

namespace r4::tool {

// "r4", or "r4-send" for a subcommand.
std::string page_name(const CLI::App& root, const CLI::App& command);

// The page of `command`, which is `root` or its subcommand. Examples and exit codes of the help's
// footer become sections. The date is SOURCE_DATE_EPOCH, else today.
std::string man_page(const CLI::App& root, const CLI::App& command);

}  // namespace r4::tool
