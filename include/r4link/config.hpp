// SPDX-License-Identifier: GPL-3.0-or-later
// The version, which is written only here, and the exports of the shared library.
#pragma once

#define R4LINK_VERSION "0.2.0"

// Every other symbol is hidden; tests/install/exports.txt lists the exported symbols.
#define R4LINK_API __attribute__((visibility("default")))
#define R4LINK_PRIVATE __attribute__((visibility("hidden")))
