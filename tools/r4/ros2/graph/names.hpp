// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <string_view>

namespace r4::tool::ros2 {

struct NodeName {
  std::string space = "/";  // "/" or "/robot/left"
  std::string name = "r4";
  std::string full() const { return space == "/" ? "/" + name : space + "/" + name; }
  friend bool operator==(const NodeName&, const NodeName&) = default;
};

// `space` may omit the leading slash; empty means "/". Throws Error{usage} for names that ROS does
// not allow: parts consist of letters, digits and underscores and do not begin with a digit.
NodeName node_name(std::string_view space, std::string_view name);
// "/robot" and "board1" give "/robot/board1".
std::string below(std::string_view space, std::string_view part);

// "osmc1/state" is in the node's namespace, "~/stop" below its name, "/rosout" absolute.
std::string full_name(const NodeName& node, std::string_view topic);

// "/R4" gives "rt/R4"; for a service "rq/…Request" and "rr/…Reply".
std::string dds_topic(std::string_view full_name);
std::string dds_request(std::string_view full_name);
std::string dds_reply(std::string_view full_name);

}  // namespace r4::tool::ros2
