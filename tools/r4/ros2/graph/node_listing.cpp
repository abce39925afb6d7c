// SPDX-License-Identifier: GPL-3.0-or-later
#include "node_listing.hpp"

#include <algorithm>
#include <cstring>
#include <string_view>
#include <type_traits>
#include <utility>

#include "message_types.hpp"

namespace r4::tool::ros2 {
namespace {

constexpr const char* listing_topic = "ros_discovery_info";

template <class Gid>
Gid gid_from(const EntityId& id) {
  Gid gid{};  // the rest of a longer id stays zero
  std::memcpy(gid.data, id.data(), id.size());
  return gid;
}

template <class Message>
void write(dds_entity_t writer, const EntityId& participant, const std::vector<Node>& nodes) {
  using Gid = decltype(Message::gid);
  using Entry = std::remove_pointer_t<decltype(Message::node_entities_info_seq._buffer)>;
  std::vector<std::vector<Gid>> gids;
  const auto fill = [&gids](auto& sequence, const std::vector<EntityId>& ids) {
    std::vector<Gid>& list = gids.emplace_back();
    for (const EntityId& id : ids) list.push_back(gid_from<Gid>(id));
    sequence._length = sequence._maximum = static_cast<std::uint32_t>(list.size());
    sequence._buffer = list.data();
  };
  std::vector<Entry> entries;
  for (const Node& node : nodes) {
    Entry entry{};
    entry.node_namespace = borrowed(node.name.space);
    entry.node_name = borrowed(node.name.name);
    fill(entry.reader_gid_seq, node.readers);
    fill(entry.writer_gid_seq, node.writers);
    entries.push_back(entry);
  }
  Message message{};
  message.gid = gid_from<Gid>(participant);
  message.node_entities_info_seq._length = static_cast<std::uint32_t>(entries.size());
  message.node_entities_info_seq._maximum = message.node_entities_info_seq._length;
  message.node_entities_info_seq._buffer = entries.data();
  (void)dds_write(writer, &message);
}

}  // namespace

std::optional<Release> release_of(const std::string& distro) {
  if (distro.empty()) return std::nullopt;
  // Release names are in alphabetical order.
  return distro < "iron" ? Release::before_iron : Release::since_iron;
}

NodeListing::NodeListing(dds_entity_t participant, std::vector<Node> nodes,
                         const std::string& distro)
    : participant_(participant),
      id_(id_of(participant)),
      nodes_(std::move(nodes)),
      fixed_(release_of(distro)) {
  if (fixed_) speak_to(*fixed_);
}

void NodeListing::on_announced(const Announced& announced) {
  if (announced.gone) {
    if (others_.erase(announced.id) == 0) return;
  } else {
    if (announced.kind != EndpointKind::writer || announced.topic != listing_topic) return;
    const bool hashed = announced.user_data.find("typehash=") != std::string::npos;
    others_[announced.id] = hashed ? Release::since_iron : Release::before_iron;
  }
  if (const auto release = wanted(); release && release != spoken_) speak_to(*release);
}

void NodeListing::change(std::size_t index, const Node& node) {
  nodes_[index] = node;
  publish();
}

std::optional<Release> NodeListing::wanted() const {
  if (fixed_) return fixed_;
  const bool spoken_is_read =
      spoken_ && std::any_of(others_.begin(), others_.end(),
                             [this](const auto& other) { return other.second == *spoken_; });
  if (spoken_is_read || others_.empty()) return spoken_;
  return others_.begin()->second;
}

void NodeListing::speak_to(Release release) {
  writer_.reset();
  topic_.reset();
  spoken_ = release;
  const MessageType& type = release == Release::since_iron ? message_type<NodesMessage>()
                                                           : message_type<NodesBeforeIronMessage>();
  Qos qos;
  qos.depth = 1;
  qos.transient_local = true;
  qos.user_data = user_data_of(type);
  const QosPtr made = make_qos(qos);
  topic_ =
      Entity(dds_create_topic(participant_, type.descriptor, listing_topic, made.get(), nullptr),
             listing_topic);
  writer_ =
      Entity(dds_create_writer(participant_, topic_.get(), made.get(), nullptr), listing_topic);
  publish();
}

void NodeListing::publish() const {
  if (!spoken_) return;
  if (*spoken_ == Release::since_iron) {
    write<NodesMessage>(writer_.get(), id_, nodes_);
  } else {
    write<NodesBeforeIronMessage>(writer_.get(), id_, nodes_);
  }
}

void NodeListing::leave() {
  nodes_.clear();
  publish();
}

}  // namespace r4::tool::ros2
