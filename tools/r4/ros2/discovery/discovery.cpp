// SPDX-License-Identifier: GPL-3.0-or-later
#include "discovery.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "tools/r4/shell/json.hpp"

namespace r4::tool::ros2 {
namespace {

constexpr std::size_t most = 64;
// Participants are examined first, because each reader or writer is reported with its participant's
// process. Remaining samples wait for the next look, because stops are read on the same thread.
constexpr int most_rounds = 16;

// Takes samples of a built-in topic: take(sample, whether its subject exists).
template <class Sample, class Take>
void take_some(dds_entity_t reader, int rounds, Take take) {
  std::array<void*, most> samples{};
  std::array<dds_sample_info_t, most> infos{};
  for (int round = 0; round < rounds; ++round) {
    const dds_return_t count = dds_take(reader, samples.data(), infos.data(), most, most);
    if (count <= 0) return;
    for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
      take(*static_cast<const Sample*>(samples[i]),
           infos[i].instance_state == DDS_IST_ALIVE && infos[i].valid_data);
    }
    (void)dds_return_loan(reader, samples.data(), count);
  }
}

// A property of a participant's process, set by Cyclone DDS only.
std::string property(const dds_qos_t* qos, const char* name) {
  char* value = nullptr;
  if (qos == nullptr || !dds_qget_prop(qos, name, &value) || value == nullptr) return {};
  std::string text = escaped(value);
  dds_free(value);
  return text;
}

Entity built_in(dds_entity_t participant, dds_entity_t topic) {
  return {dds_create_reader(participant, topic, nullptr, nullptr), "what is in the graph"};
}

}  // namespace

Discovery::Discovery(const std::vector<dds_entity_t>& own, Tell tell)
    : tell_(std::move(tell)),
      participants_(built_in(own.front(), DDS_BUILTIN_TOPIC_DCPSPARTICIPANT)),
      writers_(built_in(own.front(), DDS_BUILTIN_TOPIC_DCPSPUBLICATION)),
      readers_(built_in(own.front(), DDS_BUILTIN_TOPIC_DCPSSUBSCRIPTION)) {
  for (const dds_entity_t each : own) own_.push_back(id_of(each));
}

void Discovery::look() {
  look_at_participants();  // participants before readers and writers
  look_at(EndpointKind::writer, writers_.get());
  look_at(EndpointKind::reader, readers_.get());
}

void Discovery::look_at_participants() {
  take_some<dds_builtintopic_participant_t>(
      participants_.get(), most_rounds,
      [this](const dds_builtintopic_participant_t& each, bool there) {
        if (!there) {
          owners_.erase(id_from(each.key));
          return;
        }
        const std::string process = property(each.qos, "__Pid");
        if (process.empty()) return;
        owners_[id_from(each.key)] =
            fmt::format("process {} on {}", process, property(each.qos, "__Hostname"));
      });
}

void Discovery::look_at(EndpointKind kind, dds_entity_t entity) {
  take_some<dds_builtintopic_endpoint_t>(
      entity, 1, [this, kind](const dds_builtintopic_endpoint_t& each, bool there) {
        Announced announced;
        announced.kind = kind;
        announced.id = id_from(each.key);
        announced.gone = !there;
        if (there) {
          const EntityId participant = id_from(each.participant_key);
          const bool ours = std::find(own_.begin(), own_.end(), participant) != own_.end();
          if (ours || each.topic_name == nullptr || each.type_name == nullptr) return;
          announced.topic = each.topic_name;
          announced.type = each.type_name;
          announced.user_data = user_data_of(each.qos);
          announced.policies = policies_of(kind, each.qos);
          const auto owner = owners_.find(participant);
          if (owner != owners_.end()) announced.owner = owner->second;
        }
        tell_(announced);
      });
}

}  // namespace r4::tool::ros2
