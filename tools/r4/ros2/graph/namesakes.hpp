// SPDX-License-Identifier: GPL-3.0-or-later
// Who else has a node of the same name: a second `r4 ros2`, for one. Told by the service ~/stop, which each of our
// nodes has: somebody else who answers it has the name, too.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "entity.hpp"
#include "names.hpp"
#include "node_listing.hpp"

namespace r4::tool::ros2 {

class Namesakes {
 public:
  // `who`: as far as it says so, "process 1234 on robot". On the thread that looks.
  using Tell = std::function<void(const NodeName& node, const std::string& who)>;
  Namesakes(dds_entity_t participant, const std::vector<Node>& nodes, Tell tell);

  // Tells of writers that come, to be waited for; look() then.
  dds_entity_t writers() const { return writers_.get(); }
  void look();

 private:
  void look_at_participants();

  const EntityId own_;
  std::map<std::string, NodeName> nodes_;  // by the topic on which they would answer
  const Tell tell_;
  std::map<EntityId, std::string> participants_there_;  // who they are, of those that say so
  Entity participants_;
  Entity writers_;
};

}  // namespace r4::tool::ros2
