// SPDX-License-Identifier: GPL-3.0-or-later
// What an 11-bit CAN id means to protocols that are often on a robot's bus beside R4.
#pragma once

#include <cstdint>
#include <string>

namespace r4::tool {

// By CANopen's predefined connection set (CiA 301, 7.3.3) and by ODrive's CANSimple: "CANopen TPDO1
// of node 5, or ODrive axis 12". Both may name an id; which of them it is, the id alone does not
// tell.
std::string foreign_names(std::uint32_t id);

}  // namespace r4::tool
