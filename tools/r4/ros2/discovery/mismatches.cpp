// SPDX-License-Identifier: GPL-3.0-or-later
#include "mismatches.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>

#include "r4link/error.hpp"

namespace r4::tool::ros2 {
namespace {

using Weight = Mismatch::Weight;

std::vector<const OwnEndpoint*> counterparts(const Graph::OwnTopic& own, const Announced& other) {
  std::vector<const OwnEndpoint*> found;
  for (const OwnEndpoint& each : own.endpoints) {
    if (each.kind != other.kind) found.push_back(&each);
  }
  return found;
}

std::optional<Mismatch> wrong_type(const OwnEndpoint& ours, const Announced& other) {
  const std::string expected = ros_type(ours.type);
  if (other.kind == EndpointKind::writer) {
    return Mismatch{
        Weight::lost,
        fmt::format(
            "{}: a publisher ({}) has the wrong type {}, so its messages are ignored; publish {}",
            ours.name, other.owner_text(), ros_type(other.type), expected)};
  }
  return Mismatch{
      Weight::warning,
      fmt::format(
          "{}: a subscriber ({}) has the wrong type {}, so it receives nothing; subscribe to {}",
          ours.name, other.owner_text(), ros_type(other.type), expected)};
}

std::optional<Mismatch> wrong_policy(const OwnEndpoint& ours, const Announced& other,
                                     const char* policy) {
  if (other.kind == EndpointKind::writer) {
    return Mismatch{Weight::lost,
                    fmt::format("{}: a publisher does not offer the required {}, so its messages "
                                "are ignored ({}); use the default settings of ROS",
                                ours.name, policy, other.owner_text())};
  }
  return Mismatch{Weight::warning,
                  fmt::format("{}: a subscriber requires more {} than this publisher offers, so it "
                              "receives nothing ({}); use the default settings of ROS",
                              ours.name, policy, other.owner_text())};
}

// Requests in the form of rmw_fastrtps, without a client id (docs/how-to/ros2.md, Services).
bool cannot_be_answered(const OwnEndpoint& ours, const Announced& other) {
  return other.kind == EndpointKind::writer && ours.name.starts_with("~/") &&
         other.user_data.find("clientid=") == std::string::npos;
}

std::optional<Mismatch> no_answer(const OwnEndpoint& ours, const Announced& other) {
  return Mismatch{
      Weight::lost,
      fmt::format("{}: a client ({}) does not use rmw_cyclonedds_cpp, so its requests are not "
                  "executed or answered; set RMW_IMPLEMENTATION=rmw_cyclonedds_cpp for the client, "
                  "or use the topics arm, stop and R4_Command",
                  ours.name, other.owner_text())};
}

}  // namespace

std::optional<Mismatch> mismatch_of(const Graph::OwnTopic& own, const Announced& other) {
  const auto is_declared = [&other](const OwnEndpoint* each) {
    return each->is_declared && each->type == other.type;
  };
  const auto declared = counterparts(own, other);
  std::optional<Mismatch> of_type;
  if (other.kind == EndpointKind::writer && own.other_type &&
      std::none_of(declared.begin(), declared.end(), is_declared)) {
    try {
      of_type = own.other_type(other);
    } catch (const Error& error) {  // Cyclone DDS cannot create a reader for that type
      of_type =
          Mismatch{Weight::lost, fmt::format("{}: a publisher ({}) is not received: {}", own.name,
                                             other.owner_text(), error.problem().text())};
    }
  }
  const auto ours = counterparts(own, other);  // other_type() may have added an endpoint
  std::optional<Mismatch> of_policy;
  for (const OwnEndpoint* const each : ours) {
    if (each->type != other.type) continue;
    const bool reads = each->kind == EndpointKind::reader;
    const char* const policy = reads ? unmatched_policy(other.policies, each->policies)
                                     : unmatched_policy(each->policies, other.policies);
    if (policy == nullptr) {
      return cannot_be_answered(*each, other) ? no_answer(*each, other) : of_type;
    }
    if (!of_policy) of_policy = wrong_policy(*each, other, policy);
  }
  if (of_policy) return of_policy;
  if (of_type || ours.empty()) return of_type;
  return wrong_type(*ours.front(), other);
}

void Mismatches::on_announced(const Announced& announced) {
  std::optional<Mismatch> mismatch;
  const Graph::OwnTopic* const own = announced.gone ? nullptr : graph_.own_topic(announced.topic);
  if (own != nullptr) mismatch = mismatch_of(*own, announced);
  const auto told = told_.find(announced.id);
  if (mismatch) {
    const std::size_t node = own->endpoints.empty() ? own->node : own->endpoints.front().node;
    told_[announced.id] = node;
    tell_(node, announced.id, mismatch);
  } else if (told != told_.end()) {
    tell_(told->second, announced.id, std::nullopt);
    told_.erase(told);
  }
}

}  // namespace r4::tool::ros2
