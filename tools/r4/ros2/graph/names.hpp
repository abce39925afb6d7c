// SPDX-License-Identifier: GPL-3.0-or-later
// Names of nodes and topics in ROS 2, and what they are called in DDS.
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

// `space` with or without the slash before it, empty for "/". Throws Error{usage} for what ROS does not take: parts
// of letters, digits and underscores that do not begin with a digit.
NodeName node_name(std::string_view space, std::string_view name);
// One part more: "/robot" and "board1".
std::string below(std::string_view space, std::string_view part);

// A topic as a node names it: "osmc1/state" is in its namespace, "~/stop" below its name, "/rosout" stands alone.
std::string full_name(const NodeName& node, std::string_view topic);

// "/R4" is "rt/R4"; of a service "rq/…Request" and "rr/…Reply".
std::string dds_topic(std::string_view full_name);
std::string dds_request(std::string_view full_name);
std::string dds_reply(std::string_view full_name);

}  // namespace r4::tool::ros2
