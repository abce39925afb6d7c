// SPDX-License-Identifier: GPL-3.0-or-later
// Supports `ros2 node list`: each participant publishes its nodes with their readers and writers on
// ros_discovery_info. An id has 24 bytes up to Humble and 16 since Iron, under one type name, and
// the wrong size makes a receiver throw. So nothing is published until the type hash of another
// participant's writer shows its release. ROS cannot mix releases, so the first release is used.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "announced.hpp"
#include "entity.hpp"
#include "names.hpp"

namespace r4::tool::ros2 {

struct Node {
  NodeName name;
  std::vector<EntityId> readers;
  std::vector<EntityId> writers;
};

enum class Release : std::uint8_t { before_iron, since_iron };
std::optional<Release> release_of(const std::string& distro);

class NodeListing {
 public:
  NodeListing(dds_entity_t participant, std::vector<Node> nodes, const std::string& distro);

  void on_announced(const Announced& announced);
  void change(std::size_t index, const Node& node);

  void leave();

 private:
  std::optional<Release> wanted() const;
  void speak_to(Release release);
  void publish() const;

  const dds_entity_t participant_;
  const EntityId id_;
  std::vector<Node> nodes_;
  const std::optional<Release> fixed_;
  std::map<EntityId, Release> others_;
  std::optional<Release> spoken_;
  Entity topic_;
  Entity writer_;
};

}  // namespace r4::tool::ros2
