// SPDX-License-Identifier: GPL-3.0-or-later
// What the system knows of a CAN interface, and how it is brought up.
#pragma once

#include <string>

#include "error.hpp"

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

// What an errno of a socket on that interface means, with the fix where there is one.
Problem can_problem(const std::string& interface, int error);

}  // namespace r4
