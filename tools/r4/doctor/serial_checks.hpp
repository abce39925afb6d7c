// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "finding.hpp"
#include "machine.hpp"

namespace r4::tool {

// "/dev/ttyACM0": the ports with a board's USB id, and FTDI adapters.
std::vector<std::string> likely_ports(const Machine& machine);

Findings check_port_permission(const Machine& machine, const std::string& path);
// Programs visible to this user. `sharing`: the program that shares the port; 0: none.
Findings check_port_holders(const Machine& machine, const std::string& path, pid_t sharing);
Findings check_latency_timer(const Machine& machine, const std::string& path);
// Checks that the installed udev rules equal `rules`, and that ModemManager ignores boards.
Findings check_udev_rules(const Machine& machine, std::string_view rules);
// Reports a brltty rule (braille displays) that claims USB serial adapters of `ports`.
Findings check_brltty(const Machine& machine, const std::vector<std::string>& ports);

}  // namespace r4::tool
