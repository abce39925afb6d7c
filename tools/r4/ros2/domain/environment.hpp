// SPDX-License-Identifier: GPL-3.0-or-later
// Selects the ROS 2 graph and its reach by the environment variables of ROS. Default: loopback.
//     ROS_DOMAIN_ID                   0-232; 0
//     ROS_AUTOMATIC_DISCOVERY_RANGE   LOCALHOST (ours by default), SUBNET, OFF, SYSTEM_DEFAULT
//     ROS_LOCALHOST_ONLY              older releases: 1: LOCALHOST, overrides the range; 0: SUBNET
//     ROS_STATIC_PEERS                addresses of further computers, separated by semicolons
//     CYCLONEDDS_URI                  Cyclone's own configuration: overrides all except the domain
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace r4::tool::ros2 {

struct Domain {
  std::uint32_t id = 0;
  std::string configuration;  // Cyclone's XML; empty: CYCLONEDDS_URI or Cyclone's default
  std::string reach;          // in words, "this computer"
  bool one_computer = false;  // limited to this computer
};

using Environment = std::function<std::string(const char* name)>;
std::string process_environment(const char* name);

// Throws Error{usage} naming a variable with a wrong value.
Domain domain_of(const Environment& environment);

}  // namespace r4::tool::ros2
