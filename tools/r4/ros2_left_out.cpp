// SPDX-License-Identifier: GPL-3.0-or-later
// Replaces services.cpp in a build with -DR4_ROS2=OFF.
#include "r4link/error.hpp"
#include "ros2/bridge.hpp"

namespace r4::tool::ros2 {

int run_bridge(const BridgeOptions&) {
  throw Error(
      ErrorKind::unsupported, "r4 ros2", "this build of r4 does not include it (R4_ROS2=OFF)",
      "install Cyclone DDS 0.9 or newer (cyclonedds-dev, cyclonedds-tools; the version in Ubuntu "
      "22.04 is too old), and build r4 with cmake -DR4_ROS2=ON");
}

}  // namespace r4::tool::ros2
