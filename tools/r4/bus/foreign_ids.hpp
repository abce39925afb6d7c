// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>

namespace r4::tool {

// Uses CANopen's predefined connection set (CiA 301, 7.3.3) and ODrive's CANSimple: "CANopen TPDO1
// of node 5, or ODrive axis 12". The id alone cannot distinguish the two protocols.
std::string foreign_names(std::uint32_t id);

}  // namespace r4::tool
