// SPDX-License-Identifier: GPL-3.0-or-later
// plot.py, embedded by the build.
#pragma once

namespace r4::tool {

extern const char* const plot_script;

}  // namespace r4::tool
