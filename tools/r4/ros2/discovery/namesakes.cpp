// SPDX-License-Identifier: GPL-3.0-or-later
#include "namesakes.hpp"

namespace r4::tool::ros2 {

Namesakes::Namesakes(const std::vector<Node>& nodes) {
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    nodes_[dds_reply(full_name(nodes[i].name, "~/stop"))] = i;
  }
}

std::optional<std::size_t> Namesakes::node_of(const Announced& announced) const {
  if (announced.gone || announced.kind != EndpointKind::writer) return std::nullopt;
  const auto node = nodes_.find(announced.topic);
  if (node == nodes_.end()) return std::nullopt;
  return node->second;
}

}  // namespace r4::tool::ros2
