// SPDX-License-Identifier: GPL-3.0-or-later
// Serial ports: may they be opened, who has them, what gets in the way.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "finding.hpp"
#include "machine.hpp"

namespace r4::tool {

// The ports of boards, by their USB ids, and those of FTDI adapters: "/dev/ttyACM0".
std::vector<std::string> likely_ports(const Machine& machine);

// Whether this user may open it: its mode and groups.
Findings check_port_permission(const Machine& machine, const std::string& path);
// Programs that have it open, as far as this user may see. `sharing`: the one that lets others share it, 0: none.
Findings check_port_holders(const Machine& machine, const std::string& path, pid_t sharing);
// How long an FTDI adapter keeps what has come.
Findings check_latency_timer(const Machine& machine, const std::string& path);
// Whether the rules of udev are there, and are `rules`; and whether ModemManager, if it runs, keeps off by them.
Findings check_udev_rules(const Machine& machine, std::string_view rules);
// Whether a rule of brltty, which is for braille displays, takes the USB serial adapters that `ports` are or may be.
Findings check_brltty(const Machine& machine, const std::vector<std::string>& ports);

}  // namespace r4::tool
