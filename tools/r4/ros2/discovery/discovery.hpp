// SPDX-License-Identifier: GPL-3.0-or-later
// The readers and writers that other participants of the graph announce, as they come, change and
// go.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "tools/r4/ros2/graph/announced.hpp"
#include "tools/r4/ros2/graph/entity.hpp"

namespace r4::tool::ros2 {

class Discovery {
 public:
  using Tell = std::function<void(const Announced& announced)>;
  // `own`: our participants, of which nothing is reported.
  Discovery(const std::vector<dds_entity_t>& own, Tell tell);

  // When one of these has something to be read, call look().
  std::array<dds_entity_t, 2> entities() const { return {writers_.get(), readers_.get()}; }
  // Calls `tell` for each change.
  void look();

 private:
  void look_at_participants();
  void look_at(EndpointKind kind, dds_entity_t entity);

  std::vector<EntityId> own_;
  const Tell tell_;
  std::map<EntityId, std::string> owners_;  // of the participants that name their process
  Entity participants_;
  Entity writers_;
  Entity readers_;
};

}  // namespace r4::tool::ros2
