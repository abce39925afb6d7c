// SPDX-License-Identifier: GPL-3.0-or-later
// tools/udev/70-r4.rules, embedded by the build.
#pragma once

namespace r4::tool {

extern const char* const udev_rules;

}  // namespace r4::tool
