// SPDX-License-Identifier: GPL-3.0-or-later
// Finds nodes of the same names as ours: a second `r4 ros2`, for one. Each of our nodes has the
// service ~/stop. Another participant that answers it has a node of that name, too.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tools/r4/ros2/graph/announced.hpp"
#include "tools/r4/ros2/graph/node_listing.hpp"

namespace r4::tool::ros2 {

class Namesakes {
 public:
  explicit Namesakes(const std::vector<Node>& nodes);
  // The number of our node that has the same name as the owner of that endpoint.
  std::optional<std::size_t> node_of(const Announced& announced) const;

 private:
  std::map<std::string, std::size_t> nodes_;  // by the topic on which they answer
};

}  // namespace r4::tool::ros2
