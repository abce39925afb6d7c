// SPDX-License-Identifier: GPL-3.0-or-later
// The Foxglove WebSocket protocol (foxglove.websocket.v1, github.com/foxglove/ws-protocol),
// read-only. A board has topics for records (as in MCAP files of r4 convert), link and events: JSON
// with schemas. Uses no sockets. Only wanted() may be called outside the server's thread.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "server/client_queue.hpp"

namespace r4::tool::web {

class Foxglove {
 public:
  using ClientId = std::uint32_t;
  using Send = std::function<void(ClientId, Outgoing)>;
  enum class Topic : std::uint8_t { record, link, event };
  static constexpr std::size_t topics = 3;

  Foxglove(std::size_t boards, std::string session, Send send);

  void on_open(ClientId client);
  bool on_message(ClientId client, const std::string& text);
  void on_closed(ClientId client);

  // Sets a board's name, new or changed, and advertises its topics again.
  void name(std::size_t board, const std::string& name);
  // True if a client is subscribed. Call from any thread.
  bool wanted(std::size_t board, Topic topic) const {
    return channel(board, topic).subscribers > 0;
  }
  void publish(std::size_t board, Topic topic, std::int64_t time_us, std::string json);

 private:
  using SubscriptionId = std::uint32_t;
  struct Channel {
    std::uint32_t id = 0;
    std::string topic;
    std::atomic<int> subscribers{0};
  };
  using Subscriptions = std::map<SubscriptionId, Channel*>;

  const Channel& channel(std::size_t board, Topic topic) const {
    return channels_[board * topics + static_cast<std::size_t>(topic)];
  }
  std::string advertisement(std::size_t first, std::size_t end) const;
  void subscribe(ClientId client, Subscriptions& mine, SubscriptionId id, std::uint64_t channel);
  void unsubscribe(Subscriptions& mine, SubscriptionId id);
  void tell(ClientId client, std::string json);

  const std::string session_;
  const Send send_;
  std::vector<Channel> channels_;
  std::vector<std::string> names_;
  std::uint32_t next_id_ = 1;
  std::map<ClientId, Subscriptions> clients_;
};

}  // namespace r4::tool::web
