// SPDX-License-Identifier: GPL-3.0-or-later
#include "foxglove.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <utility>

#include "../formats/byte_order.hpp"
#include "../formats/mcap/mcap.hpp"
#include "../formats/mcap/schemas.hpp"
#include "../shell/json.hpp"

namespace r4::tool::web {
namespace {

constexpr std::uint8_t message_data = 0x01;

struct TopicForm {
  const char* suffix;
  const char* schema;
};
constexpr std::array<TopicForm, Foxglove::topics> forms{
    {{"", nullptr}, {"/link", "r4.Link"}, {"/events", "r4.Event"}}};

std::string schema_of(Foxglove::Topic topic) {
  switch (topic) {
    case Foxglove::Topic::record:
      return mcap::record_schema_text();
    case Foxglove::Topic::link:
      return mcap::link_schema_text();
    default:
      return mcap::event_schema_text();
  }
}

bool is_id(const Json& value) {
  return value.is_number_unsigned() && value.get<std::uint64_t>() <= UINT32_MAX;
}

}  // namespace

Foxglove::Foxglove(std::size_t boards, std::string session, Send send)
    : session_(std::move(session)),
      send_(std::move(send)),
      channels_(boards * topics),
      names_(boards) {
  for (std::size_t i = 0; i < channels_.size(); ++i) {
    channels_[i].id = next_id_++;
    channels_[i].topic = fmt::format("/board{}{}", i / topics + 1, forms[i % topics].suffix);
  }
}

std::string Foxglove::advertisement(std::size_t first, std::size_t end) const {
  Json all = Json::array();
  for (std::size_t i = first; i < end; ++i) {
    const auto topic = static_cast<Topic>(i % topics);
    const char* const schema = forms[i % topics].schema;
    all.push_back(
        {{"id", channels_[i].id},
         {"topic", channels_[i].topic},
         {"encoding", "json"},
         {"schemaName", schema != nullptr ? std::string(schema) : std::string(mcap::record_schema)},
         {"schema", schema_of(topic)},
         {"schemaEncoding", "jsonschema"}});
  }
  return text_of({{"op", "advertise"}, {"channels", std::move(all)}});
}

void Foxglove::tell(ClientId client, std::string json) {
  send_(client, {std::make_shared<const std::string>(std::move(json)), "", Outgoing::Kind::other});
}

void Foxglove::on_open(ClientId client) {
  clients_[client];
  tell(client, text_of({{"op", "serverInfo"},
                        {"name", "r4 web"},
                        {"capabilities", Json::array()},
                        {"sessionId", session_}}));
  tell(client, advertisement(0, channels_.size()));
}

bool Foxglove::on_message(ClientId client, const std::string& text) {
  const auto found = clients_.find(client);
  const Json message = Json::parse(text, nullptr, false);
  if (found == clients_.end() || !message.is_object()) return false;
  const Json op = message.value("op", Json());
  if (op == "subscribe") {
    const Json list = message.value("subscriptions", Json());
    if (!list.is_array()) return false;
    for (const Json& each : list) {
      if (!each.is_object() || !is_id(each.value("id", Json())) ||
          !is_id(each.value("channelId", Json()))) {
        return false;
      }
      subscribe(client, found->second, each["id"].get<SubscriptionId>(),
                each["channelId"].get<std::uint64_t>());
    }
    return true;
  }
  if (op == "unsubscribe") {
    const Json list = message.value("subscriptionIds", Json());
    if (!list.is_array()) return false;
    for (const Json& id : list) {
      if (!is_id(id)) return false;
      unsubscribe(found->second, id.get<SubscriptionId>());
    }
    return true;
  }
  tell(client, text_of({{"op", "status"}, {"level", 1}, {"message", "r4 web is read only"}}));
  return true;
}

void Foxglove::subscribe(ClientId client, Subscriptions& mine, SubscriptionId id,
                         std::uint64_t channel) {
  const auto found = std::find_if(channels_.begin(), channels_.end(),
                                  [channel](const Channel& each) { return each.id == channel; });
  const char* why = nullptr;
  if (found == channels_.end()) why = "the channel does not exist";
  if (mine.contains(id)) why = "this subscription exists already";
  if (mine.size() == channels_.size()) why = "too many subscriptions";
  if (why != nullptr) {
    tell(client, text_of({{"op", "status"}, {"level", 2}, {"message", why}}));
    return;
  }
  mine.emplace(id, &*found);
  ++found->subscribers;
}

void Foxglove::unsubscribe(Subscriptions& mine, SubscriptionId id) {
  const auto found = mine.find(id);
  if (found == mine.end()) return;
  --found->second->subscribers;
  mine.erase(found);
}

void Foxglove::on_closed(ClientId client) {
  const auto found = clients_.find(client);
  if (found == clients_.end()) return;
  while (!found->second.empty()) unsubscribe(found->second, found->second.begin()->first);
  clients_.erase(found);
}

// In the protocol, clients that subscribed to the old name lose their subscription.
void Foxglove::name(std::size_t board, const std::string& name) {
  if (name.empty() || std::exchange(names_[board], name) == name) return;
  const bool taken = std::count(names_.begin(), names_.end(), name) > 1;
  const std::string topic = taken ? fmt::format("/{}_{}", name, board + 1) : "/" + name;
  const std::size_t first = board * topics;
  Json gone = Json::array();
  for (std::size_t i = first; i < first + topics; ++i) {
    gone.push_back(channels_[i].id);
    for (auto& [client, mine] : clients_) {
      std::erase_if(mine, [this, i](const auto& each) { return each.second == &channels_[i]; });
    }
    channels_[i].subscribers = 0;
    channels_[i].id = next_id_++;
    channels_[i].topic = topic + forms[i % topics].suffix;
  }
  const std::string unadvertise = text_of({{"op", "unadvertise"}, {"channelIds", gone}});
  const std::string advertise = advertisement(first, first + topics);
  for (const auto& each : clients_) {
    tell(each.first, unadvertise);
    tell(each.first, advertise);
  }
}

void Foxglove::publish(std::size_t board, Topic topic, std::int64_t time_us, std::string json) {
  const Channel& wanted = channel(board, topic);
  const auto body = std::make_shared<const std::string>(std::move(json));
  for (const auto& [client, mine] : clients_) {
    for (const auto& [id, each] : mine) {
      if (each != &wanted) continue;
      std::string head;
      append_number(head, message_data);
      append_number(head, id);
      append_number(head, static_cast<std::uint64_t>(time_us) * 1000);
      send_(client, {body, std::move(head),
                     topic == Topic::event ? Outgoing::Kind::other : Outgoing::Kind::state});
    }
  }
}

}  // namespace r4::tool::web
