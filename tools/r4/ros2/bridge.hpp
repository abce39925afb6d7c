// SPDX-License-Identifier: GPL-3.0-or-later
// r4 ros2: boards as nodes of a ROS 2 graph, using Cyclone DDS. Part of r4-services.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "../shell/options.hpp"

namespace r4::tool::ros2 {

struct BridgeOptions {
  std::vector<std::string> urls;
  std::string name = "r4";
  std::string space;
  std::string fields;
  std::vector<std::string> devices;
  bool arm = false;
  Milliseconds deadline{1000};
  std::string servo = "500,2500,3.14159265358979";
  std::string drive;
  std::string separation;
  std::string full_speed;
  std::string counts_per_turn;
  std::string steps_per_turn;
  std::optional<Milliseconds> duration;
  std::string key;
  bool json = false;
};

int run_bridge(const BridgeOptions& options);

}  // namespace r4::tool::ros2
