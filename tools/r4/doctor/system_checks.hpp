// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "finding.hpp"
#include "machine.hpp"

namespace r4::tool {

// Receive buffers, WiFi power saving, and a firewall that blocks boards.
Findings check_network(const Machine& machine);

// `synchronized`: a program such as NTP sets the clock (adjtimex).
Findings check_clock(bool synchronized);
bool clock_is_synchronized();
// `seconds`: how far the wall clock was set while listening.
Findings check_clock_steps(double seconds);

Findings check_processors(const Machine& machine);

}  // namespace r4::tool
