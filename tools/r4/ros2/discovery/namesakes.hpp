// SPDX-License-Identifier: GPL-3.0-or-later
// Finds nodes with our names, such as a second `r4 ros2`. Each of our nodes has the service ~/stop,
// so another participant that answers this service has a node of the same name.
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
  std::optional<std::size_t> node_of(const Announced& announced) const;

 private:
  std::map<std::string, std::size_t> nodes_;  // by topic of the replies
};

}  // namespace r4::tool::ros2
