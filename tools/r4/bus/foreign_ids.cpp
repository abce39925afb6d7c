// SPDX-License-Identifier: GPL-3.0-or-later
#include "foreign_ids.hpp"

#include <fmt/format.h>

#include <array>

namespace r4::tool {
namespace {

// CANopen: the upper four bits of an id are the function, the lower seven the node (not 0).
constexpr std::uint32_t canopen_node_bits = 7;
constexpr std::array<const char*, 16> canopen_functions{
    nullptr, "EMCY",  nullptr, "TPDO1",      "RPDO1",       "TPDO2", "RPDO2",     "TPDO3",
    "RPDO3", "TPDO4", "RPDO4", "SDO answer", "SDO request", nullptr, "heartbeat", nullptr};

std::string canopen_name(std::uint32_t id) {
  switch (id) {
    case 0x000:
      return "CANopen NMT";
    case 0x080:
      return "CANopen SYNC";
    case 0x100:
      return "CANopen TIME";
    default:
      break;
  }
  const std::uint32_t node = id & ((1U << canopen_node_bits) - 1);
  const char* const function = canopen_functions.at(id >> canopen_node_bits);
  if (node == 0 || function == nullptr) return "";
  return fmt::format("CANopen {} of node {}", function, node);
}

// ODrive: the upper six bits of an id are the axis, the lower five the command.
std::string odrive_name(std::uint32_t id) {
  const char* command = "";
  switch (id & 0x1F) {
    case 0x01:
      command = " heartbeat";
      break;
    case 0x09:
      command = " encoder";
      break;
    case 0x0C:
      command = " set position";
      break;
    case 0x0D:
      command = " set velocity";
      break;
    case 0x0E:
      command = " set torque";
      break;
    default:
      break;
  }
  return fmt::format("ODrive axis {}{}", id >> 5, command);
}

}  // namespace

std::string foreign_names(std::uint32_t id) {
  const std::string canopen = canopen_name(id);
  return canopen.empty() ? odrive_name(id) : canopen + ", or " + odrive_name(id);
}

}  // namespace r4::tool
