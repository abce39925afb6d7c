// SPDX-License-Identifier: GPL-3.0-or-later
// Which ROS 2 graph is joined, and how far it reaches, by the environment variables of ROS. Loopback, unless they say
// otherwise.
//
//     ROS_DOMAIN_ID                   0-232; 0
//     ROS_AUTOMATIC_DISCOVERY_RANGE   LOCALHOST (ours by default), SUBNET, OFF, SYSTEM_DEFAULT
//     ROS_LOCALHOST_ONLY              1: LOCALHOST; 0: SUBNET; of older releases, and before the range
//     ROS_STATIC_PEERS                addresses, separated by semicolons: those computers, too
//     CYCLONEDDS_URI                  Cyclone's own configuration: then it alone counts, but for the domain
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace r4::tool::ros2 {

struct Domain {
  std::uint32_t id = 0;
  std::string
      configuration;  // Cyclone's, as XML; empty: what it finds in CYCLONEDDS_URI, or its own
  std::string reach;  // in words, "this computer"
  bool one_computer = false;  // nobody else's can be in it
};

// The value of a variable; empty where it is not set.
using Environment = std::function<std::string(const char* name)>;
std::string process_environment(const char* name);

// Throws Error{usage} naming the variable whose value cannot be.
Domain domain_of(const Environment& environment);

}  // namespace r4::tool::ros2
