// SPDX-License-Identifier: GPL-3.0-or-later
// CAN: does the kernel have it, and are the interfaces as docs/can.md wants them.
#pragma once

#include <string>
#include <vector>

#include "finding.hpp"
#include "machine.hpp"
#include "r4link/can/can_interface.hpp"
#include "r4link/can/can_survey.hpp"

namespace r4::tool {

// Whether the kernel has SocketCAN, or a module for it.
Findings check_can_kernel(const Machine& machine);
// One interface, as the system tells of it; also one that is not there.
Findings check_can_interface(const Machine& machine, const CanInterface& interface);
// Whether frames that are not R4's come on an id of that board.
Findings check_foreign_frames(const CanSurvey& survey, const std::string& interface,
                              std::uint8_t node);
// How full the bus is, 0 to 1 of what its bit rate carries.
Findings check_can_load(const std::string& interface, double load);

}  // namespace r4::tool
