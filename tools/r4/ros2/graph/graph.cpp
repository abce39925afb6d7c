// SPDX-License-Identifier: GPL-3.0-or-later
#include "graph.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <thread>
#include <utility>

#include "r4link/error.hpp"

namespace r4::tool::ros2 {
namespace {

// So long others take to hear that the nodes are gone, before the participant is.
constexpr std::chrono::milliseconds farewell{100};

Entity join(const Domain& domain) {
  const std::string what = fmt::format("ROS domain {}", domain.id);
  if (domain.configuration.empty()) return {};
  return {dds_create_domain(domain.id, domain.configuration.c_str()), what};
}

Entity participant_of(const Domain& domain) {
  constexpr std::string_view enclave = "enclave=/;";
  const QosPtr qos(dds_create_qos());
  dds_qset_userdata(qos.get(), enclave.data(), enclave.size());
  return {dds_create_participant(domain.id, qos.get(), nullptr),
          fmt::format("ROS domain {}", domain.id)};
}

// Who pairs the two halves of a service does it by this; as the middleware of ROS writes it.
std::string service_id(dds_entity_t participant, std::size_t number) {
  EntityId id = id_of(participant);
  id[14] = static_cast<std::uint8_t>(number >> 8);
  id[15] = static_cast<std::uint8_t>(number);
  std::string text = fmt::format("{:x}", id[0]);
  for (std::size_t i = 1; i < id.size(); ++i) text += fmt::format(".{:x}", id[i]);
  return "serviceid=" + text + ";";
}

}  // namespace

Graph::Graph(const Domain& domain) : domain_(join(domain)), participant_(participant_of(domain)) {}

Graph::~Graph() {
  leave();
  std::this_thread::sleep_until(*left_ + farewell);
}

std::size_t Graph::add_node(const NodeName& name) {
  nodes_.push_back({name, {}, {}});
  return nodes_.size() - 1;
}

dds_entity_t Graph::topic(const std::string& name, const MessageType& type) {
  const QosPtr qos = make_qos({});
  topics_.emplace_back(
      dds_create_topic(participant_.get(), type.descriptor, name.c_str(), qos.get(), nullptr),
      name);
  return topics_.back().get();
}

dds_entity_t Graph::add_writer(std::size_t node, const std::string& name, const MessageType& type,
                               Qos qos) {
  qos.user_data += user_data_of(type);
  const dds_entity_t writer =
      endpoints_
          .emplace_back(dds_create_writer(participant_.get(), topic(name, type),
                                          make_qos(qos).get(), nullptr),
                        name)
          .get();
  nodes_[node].writers.push_back(id_of(writer));
  return writer;
}

dds_entity_t Graph::add_reader(std::size_t node, const std::string& name, const MessageType& type,
                               Qos qos) {
  qos.user_data += user_data_of(type);
  const dds_entity_t reader =
      endpoints_
          .emplace_back(dds_create_reader(participant_.get(), topic(name, type),
                                          make_qos(qos).get(), nullptr),
                        name)
          .get();
  nodes_[node].readers.push_back(id_of(reader));
  return reader;
}

dds_entity_t Graph::make_writer(std::size_t node, std::string_view topic, const MessageType& type,
                                const Qos& qos) {
  const std::string name = full_name(nodes_[node].name, topic);
  publishers_.push_back({name, type.name});
  return add_writer(node, dds_topic(name), type, qos);
}

dds_entity_t Graph::make_reader(std::size_t node, std::string_view topic, const MessageType& type,
                                const Qos& qos) {
  const std::string name = full_name(nodes_[node].name, topic);
  if (subscriptions_.empty() || subscriptions_.back().name != name) {
    subscriptions_.push_back({name, type.name});
  }
  return add_reader(node, dds_topic(name), type, qos);
}

Graph::Service Graph::make_service(std::size_t node, std::string_view name, const char* type,
                                   const MessageType& request, const MessageType& response) {
  const std::string full = full_name(nodes_[node].name, name);
  Qos qos;
  qos.user_data = service_id(participant_.get(), services_.size() + 1);
  services_.push_back({full, type});
  Service service;
  service.replies = add_writer(node, dds_reply(full), response, qos);
  service.requests = add_reader(node, dds_request(full), request, qos);
  return service;
}

NodeListing& Graph::list_nodes(const std::string& distro) {
  return listing_.emplace(participant_.get(), nodes_, distro);
}

Namesakes& Graph::watch_names(Namesakes::Tell tell) {
  return namesakes_.emplace(participant_.get(), nodes_, std::move(tell));
}

void Graph::leave() {
  if (left_) return;
  if (listing_) listing_->leave();
  endpoints_.clear();
  left_ = std::chrono::steady_clock::now();
}

}  // namespace r4::tool::ros2
