// SPDX-License-Identifier: GPL-3.0-or-later
// The version, which is written here and nowhere else, and what the shared library exports.
#pragma once

#define R4LINK_VERSION "0.1.0"

// Everything else is hidden; tests/install/exports.txt lists what this is on.
#define R4LINK_API __attribute__((visibility("default")))
#define R4LINK_PRIVATE __attribute__((visibility("hidden")))
