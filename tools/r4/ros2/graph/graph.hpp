// SPDX-License-Identifier: GPL-3.0-or-later
// A participant of the ROS 2 graph: its nodes with their topics and services.
//
// All is made before list_nodes(). leave() takes the nodes out of everybody's list at once, and the end of the
// object waits until that has been told; who is killed stays in those lists for 10 s.
#pragma once

#include <chrono>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "entity.hpp"
#include "environment.hpp"
#include "message_types.hpp"
#include "names.hpp"
#include "namesakes.hpp"
#include "node_listing.hpp"

namespace r4::tool::ros2 {

// What is on the graph, in words, for who asks what this program does.
struct Endpoint {
  std::string name;  // "/R4"
  const char* type;  // "std_msgs/msg/String"
};

class Graph {
 public:
  // Throws Error{open} if the domain cannot be joined.
  explicit Graph(const Domain& domain);
  ~Graph();
  Graph(const Graph&) = delete;
  Graph& operator=(const Graph&) = delete;

  // Returns its number.
  std::size_t add_node(const NodeName& name);
  const NodeName& node(std::size_t node) const { return nodes_[node].name; }

  // `topic` as a node names it (names.hpp). A sample is read or written by its type alone.
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
  // `type` in words: "std_srvs/srv/Trigger".
  template <class Request, class Response>
  Service serve(std::size_t node, std::string_view name, const char* type) {
    return make_service(node, name, type, message_type<Request>(), message_type<Response>());
  }

  dds_entity_t participant() const { return participant_.get(); }
  NodeListing& list_nodes(const std::string& distro);
  Namesakes& watch_names(Namesakes::Tell tell);
  void leave();

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
  dds_entity_t topic(const std::string& name, const MessageType& type);
  dds_entity_t add_writer(std::size_t node, const std::string& name, const MessageType& type,
                          Qos qos);
  dds_entity_t add_reader(std::size_t node, const std::string& name, const MessageType& type,
                          Qos qos);

  Entity domain_;
  Entity participant_;
  std::vector<Node> nodes_;
  std::vector<Entity> topics_;
  std::vector<Entity> endpoints_;
  std::optional<NodeListing> listing_;
  std::optional<Namesakes> namesakes_;
  std::vector<Endpoint> publishers_;
  std::vector<Endpoint> subscriptions_;
  std::vector<Endpoint> services_;
  std::optional<std::chrono::steady_clock::time_point> left_;
};

}  // namespace r4::tool::ros2
