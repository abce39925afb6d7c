// SPDX-License-Identifier: GPL-3.0-or-later
// What `ros2 node list` reads: on ros_discovery_info each participant says which nodes it has, and which readers and
// writers are whose.
//
// Up to Humble an id has 24 bytes there and since Iron 16, under one type name, and who is told the other size
// throws. So nothing is said until somebody else is there to read it, whose own writer tells by its type hash which
// it is. Of two releases in one graph the first counts; ROS itself does not mix them either.
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
// That of ROS_DISTRO; none for an empty value.
std::optional<Release> release_of(const std::string& distro);

class NodeListing {
 public:
  NodeListing(dds_entity_t participant, std::vector<Node> nodes, const std::string& distro);

  // An endpoint of another participant has come or gone.
  void on_announced(const Announced& announced);
  // Node `index` has other readers or writers.
  void change(std::size_t index, const Node& node);

  // There are no nodes any more.
  void leave();

 private:
  std::optional<Release> wanted() const;
  void speak_to(Release release);
  void publish() const;

  const dds_entity_t participant_;
  const EntityId id_;
  std::vector<Node> nodes_;
  const std::optional<Release> fixed_;
  std::map<EntityId, Release> others_;  // who else lists its nodes
  std::optional<Release> spoken_;
  Entity topic_;
  Entity writer_;
};

}  // namespace r4::tool::ros2
