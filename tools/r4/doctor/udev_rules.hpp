// SPDX-License-Identifier: GPL-3.0-or-later
// tools/udev/70-r4.rules, which the build puts into the program.
#pragma once

namespace r4::tool {

extern const char* const udev_rules;

}  // namespace r4::tool
