// SPDX-License-Identifier: GPL-3.0-or-later
// What concerns every link of a machine: its network, its clock and its processors.
#pragma once

#include "finding.hpp"
#include "machine.hpp"

namespace r4::tool {

// Receive buffers, power saving of WiFi, and a firewall that keeps boards out.
Findings check_network(const Machine& machine);

// `synchronized`: something sets the clock (adjtimex).
Findings check_clock(bool synchronized);
bool clock_is_synchronized();
// By how much the wall clock was set while the link was listened to.
Findings check_clock_steps(double seconds);

// Frequencies of processors, and how many programs want them.
Findings check_processors(const Machine& machine);

}  // namespace r4::tool
