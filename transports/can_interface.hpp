// SPDX-License-Identifier: GPL-3.0-or-later
// What the system knows of a CAN interface, and how it is brought up.
#pragma once

#include <string>

namespace r4 {

struct CanInterface {
  bool exists = false;
  bool is_can = false;
  bool up = false;
  bool fd = false;              // takes CAN FD frames
  bool has_controller = false;  // with a bit rate; not vcan, vxcan
  int index = 0;
};

CanInterface can_interface(const std::string& name);

// The command that brings it up, for an error's fix.
std::string bring_up_fix(const std::string& name);

}  // namespace r4
