// SPDX-License-Identifier: GPL-3.0-or-later
// Finds foreign readers and writers of our topics that do not match: wrong type, wrong quality of
// service, or a service client that cannot be answered. DDS ignores such endpoints silently.
#pragma once

#include <functional>
#include <map>
#include <optional>

#include "tools/r4/ros2/graph/announced.hpp"
#include "tools/r4/ros2/graph/graph.hpp"

namespace r4::tool::ros2 {

class Mismatches {
 public:
  // `who` does not match an endpoint of `node`; no `mismatch`: `who` matches again or has left.
  using Tell = std::function<void(std::size_t node, const EntityId& who,
                                  const std::optional<Mismatch>& mismatch)>;
  Mismatches(const Graph& graph, Tell tell) : graph_(graph), tell_(std::move(tell)) {}

  void on_announced(const Announced& announced);

 private:
  const Graph& graph_;
  const Tell tell_;
  std::map<EntityId, std::size_t> told_;
};

// The mismatch of a foreign endpoint with our topic. May call the topic's `other_type`.
std::optional<Mismatch> mismatch_of(const Graph::OwnTopic& own, const Announced& other);

}  // namespace r4::tool::ros2
