// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "tools/r4/shell/cli_fwd.hpp"

namespace r4::tool {

std::string fish_script(const CLI::App& root);

}  // namespace r4::tool
