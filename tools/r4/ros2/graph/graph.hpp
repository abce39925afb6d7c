// SPDX-License-Identifier: GPL-3.0-or-later
// Our part of the ROS 2 graph: nodes with their topics and services. Cyclone DDS numbers a
// participant's entities with 14 bits, so 64 nodes share a participant. Create nodes before
// list_nodes(). Readers may follow, on the reading thread. leave() removes all nodes at once, and
// the destructor waits until the removal is sent. A killed process is listed for 10 s.
#pragma once

#include <chrono>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "../domain/environment.hpp"
#include "announced.hpp"
#include "entity.hpp"
#include "message_types.hpp"
#include "names.hpp"
#include "node_listing.hpp"

namespace r4::tool::ros2 {

struct Endpoint {
  std::string name;  // "/R4"
  const char* type;  // "std_msgs/msg/String"
};

struct OwnEndpoint {
  EndpointKind kind = EndpointKind::writer;
  std::size_t node = 0;
  std::string name;  // the node's name of the topic or service: "osmc1/state", "~/stop"
  std::string type;
  Policies policies;
  bool is_declared = true;  // false: created for a writer of another type
};

class Graph {
 public:
  static constexpr std::size_t nodes_a_participant = 64;

  // Throws Error{open} if the domain cannot be joined.
  explicit Graph(const Domain& domain);
  ~Graph();
  Graph(const Graph&) = delete;
  Graph& operator=(const Graph&) = delete;

  std::size_t add_node(const NodeName& name);
  const NodeName& node(std::size_t node) const { return nodes_[node].name; }

  // `topic`: the node's name of the topic (names.hpp). Use the entity only for samples of Message.
  template <class Message>
  dds_entity_t publish(std::size_t node, std::string_view topic, const Qos& qos = {}) {
    return make_writer(node, topic, message_type<Message>(), qos);
  }
  template <class Message>
  dds_entity_t subscribe(std::size_t node, std::string_view topic, const Qos& qos = {}) {
    return make_reader(node, topic, message_type<Message>(), qos);
  }
  struct Service {
    dds_entity_t requests = 0;
    dds_entity_t replies = 0;
  };
  // `type`: "std_srvs/srv/Trigger".
  template <class Request, class Response>
  Service serve(std::size_t node, std::string_view name, const char* type) {
    return make_service(node, name, type, message_type<Request>(), message_type<Response>());
  }

  // Sets the reaction to writers of another type, for a topic that the node reads or may read.
  void on_other_type(std::size_t node, std::string_view topic, OtherType act);

  dds_entity_t participant() const { return members_.front().participant.get(); }
  std::vector<dds_entity_t> participants() const;
  void list_nodes(const std::string& distro);
  // Call on the reading thread.
  void on_announced(const Announced& announced);
  void leave();

  const std::vector<Node>& nodes() const { return nodes_; }
  struct OwnTopic {
    std::vector<OwnEndpoint> endpoints;
    std::size_t node = 0;
    std::string name;
    OtherType other_type;
  };
  const OwnTopic* own_topic(const std::string& topic) const;

  const std::vector<Endpoint>& publishers() const { return publishers_; }
  const std::vector<Endpoint>& subscriptions() const { return subscriptions_; }
  const std::vector<Endpoint>& services() const { return services_; }

 private:
  dds_entity_t make_writer(std::size_t node, std::string_view topic, const MessageType& type,
                           const Qos& qos);
  dds_entity_t make_reader(std::size_t node, std::string_view topic, const MessageType& type,
                           const Qos& qos);
  Service make_service(std::size_t node, std::string_view name, const char* type,
                       const MessageType& request, const MessageType& response);
  dds_entity_t topic(std::size_t node, const std::string& name, const MessageType& type);
  struct EndpointName {
    std::size_t node;
    std::string name;
    std::string topic;
  };
  dds_entity_t add(EndpointKind kind, const EndpointName& name, const MessageType& type, Qos qos);
  void add_participant();

  struct Member {
    Entity participant;
    std::optional<NodeListing> listing;
  };

  const Domain domain_settings_;
  Entity domain_;
  std::vector<Member> members_;
  std::vector<Node> nodes_;
  std::vector<Entity> topics_;
  std::vector<Entity> endpoints_;
  std::map<std::string, OwnTopic> own_;
  std::vector<Endpoint> publishers_;
  std::vector<Endpoint> subscriptions_;
  std::vector<Endpoint> services_;
  std::optional<std::chrono::steady_clock::time_point> left_;
};

}  // namespace r4::tool::ros2
