// SPDX-License-Identifier: GPL-3.0-or-later
// Finds readers and writers of other participants that belong to our topics and do not match: of
// another type, of another quality of service, or service clients that cannot be answered. DDS
// ignores these silently.
#pragma once

#include <functional>
#include <map>
#include <optional>

#include "tools/r4/ros2/graph/announced.hpp"
#include "tools/r4/ros2/graph/graph.hpp"

namespace r4::tool::ros2 {

class Mismatches {
 public:
  // `who` does not match an endpoint of `node`; without a `mismatch` it does, or has gone.
  using Tell = std::function<void(std::size_t node, const EntityId& who,
                                  const std::optional<Mismatch>& mismatch)>;
  Mismatches(const Graph& graph, Tell tell) : graph_(graph), tell_(std::move(tell)) {}

  void on_announced(const Announced& announced);

 private:
  const Graph& graph_;
  const Tell tell_;
  std::map<EntityId, std::size_t> told_;  // the node of each mismatch that is there
};

// What is wrong with an endpoint for a topic of ours. May call the topic's `other_type`.
std::optional<Mismatch> mismatch_of(const Graph::OwnTopic& own, const Announced& other);

}  // namespace r4::tool::ros2
