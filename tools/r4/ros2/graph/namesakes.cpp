// SPDX-License-Identifier: GPL-3.0-or-later
#include "namesakes.hpp"

#include <fmt/format.h>

#include <array>
#include <utility>

namespace r4::tool::ros2 {
namespace {

constexpr std::size_t most_samples = 64;  // at once
// Of participants, whose names are told, before each look at writers. What is left is the next look's: stops are read on
// the same thread.
constexpr int most_rounds = 16;

// What Cyclone tells of the process of a participant; others do not.
std::string property(const dds_qos_t* qos, const char* name) {
  char* value = nullptr;
  if (qos == nullptr || !dds_qget_prop(qos, name, &value) || value == nullptr) return {};
  std::string text(value);
  dds_free(value);
  return text;
}

}  // namespace

Namesakes::Namesakes(dds_entity_t participant, const std::vector<Node>& nodes, Tell tell)
    : own_(id_of(participant)),
      tell_(std::move(tell)),
      participants_(
          dds_create_reader(participant, DDS_BUILTIN_TOPIC_DCPSPARTICIPANT, nullptr, nullptr),
          "the graph's participants"),
      writers_(dds_create_reader(participant, DDS_BUILTIN_TOPIC_DCPSPUBLICATION, nullptr, nullptr),
               "the graph's writers") {
  for (const Node& node : nodes) nodes_[dds_reply(full_name(node.name, "~/stop"))] = node.name;
}

void Namesakes::look() {
  look_at_participants();  // each comes before its writers
  std::array<void*, most_samples> samples{};
  std::array<dds_sample_info_t, most_samples> infos{};
  const dds_return_t count =
      dds_take(writers_.get(), samples.data(), infos.data(), most_samples, most_samples);
  if (count <= 0) return;
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
    const auto& writer = *static_cast<const dds_builtintopic_endpoint_t*>(samples[i]);
    if (infos[i].instance_state != DDS_IST_ALIVE || !infos[i].valid_data ||
        writer.topic_name == nullptr || id_from(writer.participant_key) == own_) {
      continue;
    }
    const auto node = nodes_.find(writer.topic_name);
    if (node == nodes_.end()) continue;
    const auto who = participants_there_.find(id_from(writer.participant_key));
    tell_(node->second, who == participants_there_.end() ? "somebody" : who->second);
  }
  (void)dds_return_loan(writers_.get(), samples.data(), count);
}

void Namesakes::look_at_participants() {
  std::array<void*, most_samples> samples{};
  std::array<dds_sample_info_t, most_samples> infos{};
  for (int round = 0; round < most_rounds; ++round) {
    const dds_return_t count =
        dds_take(participants_.get(), samples.data(), infos.data(), most_samples, most_samples);
    if (count <= 0) return;
    for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
      const auto& each = *static_cast<const dds_builtintopic_participant_t*>(samples[i]);
      if (infos[i].instance_state != DDS_IST_ALIVE || !infos[i].valid_data) {
        participants_there_.erase(id_from(each.key));
        continue;
      }
      const std::string process = property(each.qos, "__Pid");
      if (process.empty()) continue;
      participants_there_[id_from(each.key)] =
          fmt::format("process {} on {}", process, property(each.qos, "__Hostname"));
    }
    (void)dds_return_loan(participants_.get(), samples.data(), count);
  }
}

}  // namespace r4::tool::ros2
