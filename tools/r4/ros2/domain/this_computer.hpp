// SPDX-License-Identifier: GPL-3.0-or-later
// Limits Cyclone DDS to this computer. A ROS node announces this computer's addresses on its
// networks, but not 127.0.0.1. So Cyclone also uses the interfaces of those networks, and receives
// at all addresses. Packets from this computer to any of its addresses arrive on the interface lo.
// The kernel drops the packets of other interfaces.
#pragma once

#include <string>
#include <vector>

namespace r4::tool::ros2 {

// lo, and at most three interfaces that are up and have an IPv4 address. One address that Cyclone
// and a node know is enough.
std::vector<std::string> interfaces_of_this_computer();

// Filters the UDP sockets that are opened between its construction and limit().
class OnlyThisComputer {
 public:
  OnlyThisComputer();
  // Throws Error{open}.
  void limit() const;

 private:
  std::vector<int> before_;
};

}  // namespace r4::tool::ros2
