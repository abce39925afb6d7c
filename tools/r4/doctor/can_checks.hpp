// SPDX-License-Identifier: GPL-3.0-or-later
// CAN checks: kernel support, and interfaces set up as in docs/how-to/can.md.
#pragma once

#include <string>
#include <vector>

#include "finding.hpp"
#include "machine.hpp"
#include "r4link/can/can_interface.hpp"
#include "r4link/can/can_survey.hpp"

namespace r4::tool {

Findings check_can_kernel(const Machine& machine);
// The interface may be missing.
Findings check_can_interface(const Machine& machine, const CanInterface& interface);
Findings check_foreign_frames(const CanSurvey& survey, const std::string& interface,
                              std::uint8_t node);
Findings check_can_load(const std::string& interface, double load);

}  // namespace r4::tool
