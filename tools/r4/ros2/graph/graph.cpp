// SPDX-License-Identifier: GPL-3.0-or-later
#include "graph.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/select.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <thread>
#include <utility>

#include "../domain/this_computer.hpp"
#include "r4link/error.hpp"

namespace r4::tool::ros2 {
namespace {

// Time for the nodes' farewell to arrive before the participant leaves.
constexpr std::chrono::milliseconds farewell{100};

// Cyclone DDS uses select(), which aborts the process for a descriptor of FD_SETSIZE or more.
void require_low_descriptors(const std::string& what) {
  constexpr int needed = 32;  // more than a domain uses
  std::vector<int> low;
  int newest = 0;
  while (static_cast<int>(low.size()) < needed && newest >= 0 && newest < FD_SETSIZE) {
    newest = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
    if (newest >= 0) low.push_back(newest);
  }
  for (const int each : low) ::close(each);
  if (newest >= 0 && newest < FD_SETSIZE) return;
  throw Error(ErrorKind::open, what,
              fmt::format("too many files are open in this process; Cyclone DDS needs {} free "
                          "descriptors below {}",
                          needed, FD_SETSIZE),
              "start r4 ros2 from a program that does not pass its open files to r4 ros2, and "
              "raise `ulimit -n` if it is lower");
}

Entity join(const Domain& domain) {
  const std::string what = fmt::format("ROS domain {}", domain.id);
  require_low_descriptors(what);
  if (domain.configuration.empty()) return {};
  const OnlyThisComputer only_this_computer;
  Entity joined(dds_create_domain(domain.id, domain.configuration.c_str()), what);
  if (domain.one_computer) only_this_computer.limit();
  return joined;
}

Entity participant_of(const Domain& domain) {
  constexpr std::string_view enclave = "enclave=/;";
  const QosPtr qos(dds_create_qos());
  dds_qset_userdata(qos.get(), enclave.data(), enclave.size());
  return {dds_create_participant(domain.id, qos.get(), nullptr),
          fmt::format("ROS domain {}", domain.id)};
}

// Identifies the two halves of a service, in the format of the ROS middleware.
std::string service_id(dds_entity_t participant, std::size_t number) {
  EntityId id = id_of(participant);
  id[14] = static_cast<std::uint8_t>(number >> 8);
  id[15] = static_cast<std::uint8_t>(number);
  std::string text = fmt::format("{:x}", id[0]);
  for (std::size_t i = 1; i < id.size(); ++i) text += fmt::format(".{:x}", id[i]);
  return "serviceid=" + text + ";";
}

}  // namespace

Graph::Graph(const Domain& domain) : domain_settings_(domain), domain_(join(domain)) {
  add_participant();
}

Graph::~Graph() {
  leave();
  std::this_thread::sleep_until(*left_ + farewell);
}

void Graph::add_participant() { members_.push_back({participant_of(domain_settings_), {}}); }

std::vector<dds_entity_t> Graph::participants() const {
  std::vector<dds_entity_t> all;
  for (const Member& each : members_) all.push_back(each.participant.get());
  return all;
}

std::size_t Graph::add_node(const NodeName& name) {
  if (nodes_.size() == members_.size() * nodes_a_participant) add_participant();
  nodes_.push_back({name, {}, {}});
  return nodes_.size() - 1;
}

dds_entity_t Graph::topic(std::size_t node, const std::string& name, const MessageType& type) {
  const QosPtr qos = make_qos({});
  return topics_
      .emplace_back(dds_create_topic(members_[node / nodes_a_participant].participant.get(),
                                     type.descriptor, name.c_str(), qos.get(), nullptr),
                    name)
      .get();
}

dds_entity_t Graph::add(EndpointKind kind, const EndpointName& name, const MessageType& type,
                        Qos qos) {
  qos.user_data += user_data_of(type);
  const QosPtr made = make_qos(qos);
  Member& member = members_[name.node / nodes_a_participant];
  const auto create = kind == EndpointKind::reader ? dds_create_reader : dds_create_writer;
  const dds_entity_t endpoint =
      endpoints_
          .emplace_back(create(member.participant.get(), topic(name.node, name.topic, type),
                               made.get(), nullptr),
                        name.topic)
          .get();
  Node& node = nodes_[name.node];
  (kind == EndpointKind::reader ? node.readers : node.writers).push_back(id_of(endpoint));
  own_[name.topic].endpoints.push_back({kind, name.node, name.name, type.descriptor->m_typename,
                                        policies_of(kind, made.get()), !member.listing});
  if (member.listing) member.listing->change(name.node % nodes_a_participant, node);
  return endpoint;
}

dds_entity_t Graph::make_writer(std::size_t node, std::string_view topic, const MessageType& type,
                                const Qos& qos) {
  const std::string name = full_name(nodes_[node].name, topic);
  publishers_.push_back({name, type.name});
  return add(EndpointKind::writer, {node, std::string(topic), dds_topic(name)}, type, qos);
}

dds_entity_t Graph::make_reader(std::size_t node, std::string_view topic, const MessageType& type,
                                const Qos& qos) {
  const std::string name = full_name(nodes_[node].name, topic);
  if (subscriptions_.empty() || subscriptions_.back().name != name) {
    subscriptions_.push_back({name, type.name});
  }
  return add(EndpointKind::reader, {node, std::string(topic), dds_topic(name)}, type, qos);
}

void Graph::on_other_type(std::size_t node, std::string_view topic, OtherType act) {
  OwnTopic& own = own_[dds_topic(full_name(nodes_[node].name, topic))];
  own.node = node;
  own.name = topic;
  own.other_type = std::move(act);
}

const Graph::OwnTopic* Graph::own_topic(const std::string& topic) const {
  const auto own = own_.find(topic);
  return own == own_.end() ? nullptr : &own->second;
}

Graph::Service Graph::make_service(std::size_t node, std::string_view name, const char* type,
                                   const MessageType& request, const MessageType& response) {
  const std::string full = full_name(nodes_[node].name, name);
  Qos qos;
  qos.user_data =
      service_id(members_[node / nodes_a_participant].participant.get(), services_.size() + 1);
  services_.push_back({full, type});
  Service service;
  service.replies =
      add(EndpointKind::writer, {node, std::string(name), dds_reply(full)}, response, qos);
  service.requests =
      add(EndpointKind::reader, {node, std::string(name), dds_request(full)}, request, qos);
  return service;
}

void Graph::list_nodes(const std::string& distro) {
  for (std::size_t i = 0; i < members_.size(); ++i) {
    const auto first = nodes_.begin() + static_cast<std::ptrdiff_t>(i * nodes_a_participant);
    const auto left = static_cast<std::size_t>(nodes_.end() - first);
    const auto last = first + static_cast<std::ptrdiff_t>(std::min(left, nodes_a_participant));
    members_[i].listing.emplace(members_[i].participant.get(), std::vector<Node>(first, last),
                                distro);
  }
}

void Graph::on_announced(const Announced& announced) {
  for (Member& each : members_) each.listing->on_announced(announced);
}

void Graph::leave() {
  if (left_) return;
  for (Member& each : members_) {
    if (each.listing) each.listing->leave();
  }
  endpoints_.clear();
  left_ = std::chrono::steady_clock::now();
}

}  // namespace r4::tool::ros2
