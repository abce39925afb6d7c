// SPDX-License-Identifier: GPL-3.0-or-later
// Reports readers and writers of other participants when they appear, change or leave.
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
  Discovery(const std::vector<dds_entity_t>& own, Tell tell);

  // Call look() when one of these has data.
  std::array<dds_entity_t, 2> entities() const { return {writers_.get(), readers_.get()}; }
  void look();

 private:
  void look_at_participants();
  void look_at(EndpointKind kind, dds_entity_t entity);

  std::vector<EntityId> own_;
  const Tell tell_;
  std::map<EntityId, std::string> owners_;  // participants that name their process
  Entity participants_;
  Entity writers_;
  Entity readers_;
};

}  // namespace r4::tool::ros2
