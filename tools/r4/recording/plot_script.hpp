// SPDX-License-Identifier: GPL-3.0-or-later
// plot.py, which the build puts into the program.
#pragma once

namespace r4::tool {

extern const char* const plot_script;

}  // namespace r4::tool
