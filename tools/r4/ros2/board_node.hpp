// SPDX-License-Identifier: GPL-3.0-or-later
// One board as a ROS 2 node: publishes through the outbox, gets commands from the inbox.
#pragma once

#include <asio/io_context.hpp>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "board_commands.hpp"
#include "board_topics.hpp"
#include "device_topics.hpp"
#include "graph/graph.hpp"
#include "graph/inbox.hpp"
#include "graph/outbox.hpp"
#include "node_options.hpp"
#include "r4link/async_board.hpp"
#include "tools/r4/boards/timer.hpp"
#include "tools/r4/devices/device_setup.hpp"

namespace r4::tool::ros2 {

class BoardNode {
 public:
  // `logged` also gets each log message, on the loop.
  using Logged =
      std::function<void(LogLevel level, const std::string& node, const std::string& text)>;

  BoardNode(asio::io_context& io, AsyncBoard& board, Graph& graph, std::size_t node, Inbox& inbox,
            Outbox& outbox, const NodeOptions& options, Logged logged);

  // Call when the board is open.
  void start();
  void flush() { commands_.flush(); }
  void warn(const std::string& text) { log(LogLevel::warning, text); }
  // `who` is a foreign reader or writer. No `mismatch`: `who` matches our endpoint or has left.
  void on_mismatch(const EntityId& who, const std::optional<Mismatch>& mismatch);
  AsyncBoard& board() { return board_; }
  const std::string& name() const { return name_; }

 private:
  using Clock = std::chrono::steady_clock;

  void connect();
  void on_link(const LinkStatus& link);
  void tick();
  void tell_health();
  Health health() const;
  void log(LogLevel level, const std::string& told);
  void say(LogLevel level, const std::string& text);

  const NodeOptions options_;
  const std::string name_;
  const Inbox& inbox_;
  Outbox& outbox_;
  const Logged logged_;
  AsyncBoard& board_;
  const std::shared_ptr<BoardTopics> topics_;
  const std::shared_ptr<DeviceTopics> device_topics_;
  std::optional<DeviceSetup> setup_;
  BoardCommands commands_;
  Timer tick_;
  Clock::time_point next_second_{};
  std::map<EntityId, Mismatch> mismatches_;
  std::uint32_t boots_ = 0;
  bool armed_once_ = false;
  bool heard_ = false;
  bool in_control_ = false;
  std::map<std::string, Clock::time_point> said_;
};

}  // namespace r4::tool::ros2
