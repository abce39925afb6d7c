// SPDX-License-Identifier: GPL-3.0-or-later
// Subscriptions and services of a board: R4_Command, a topic for each output, cmd_vel, stop, arm.
// Runs on the boards' loop. Sends the newest setpoint of each channel, in as few datagrams as
// possible. Without a link, drops samples. Drops a sample after 250 ms, but not a stop. A lost link
// ends arm().
#pragma once

#include <asio/cancellation_signal.hpp>
#include <asio/io_context.hpp>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "drivers.hpp"
#include "graph/graph.hpp"
#include "graph/inbox.hpp"
#include "graph/outbox.hpp"
#include "graph/pressed.hpp"
#include "node_options.hpp"
#include "r4link/async_board.hpp"

namespace r4::tool::ros2 {

class BoardCommands {
 public:
  // Logs a message for people; called on the loop.
  using Say = std::function<void(LogLevel level, const std::string& text)>;

  BoardCommands(AsyncBoard& board, Graph& graph, std::size_t node, Inbox& inbox, Outbox& outbox,
                const NodeOptions& options, Say say);

  // Call when the inbox is drained.
  void flush();
  // Call about every 20 ms: stops outputs without a publisher.
  void on_tick();
  using Done = std::function<void(bool done, const std::string& text)>;
  void arm(Done done);
  // If no stop arrives before, arms when the board is connected.
  void arm_at_first();

  std::uint64_t stale() const { return stale_; }
  std::uint64_t dropped() const { return dropped_; }  // without a link, or the queue was full

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::milliseconds oldest{250};
  struct Setpoint {
    Command command;
    const void* source = nullptr;
    std::uint64_t publisher = 0;
  };

  void subscribe_text(Graph& graph, std::size_t node, Inbox& inbox);
  void subscribe_outputs(Graph& graph, std::size_t node, Inbox& inbox);
  template <class Message, class ToCommand>
  void subscribe_output(Graph& graph, std::size_t node, Inbox& inbox, const std::string& topic,
                        ToCommand to_command);
  struct Speed {
    double linear;
    double angular;
    std::optional<WallTime> stamp;
  };
  template <class Message, class Read>
  void subscribe_speed(Graph& graph, std::size_t node, Inbox& inbox, const void* source, Read read);
  void subscribe_drive(Graph& graph, std::size_t node, Inbox& inbox);
  void on_speed(const Speed& speed, const void* source, const Origin& origin);
  static void decline(Graph& graph, std::size_t node, const char* topic, Mismatch::Weight weight,
                      const char* why);
  void subscribe_stop(Graph& graph, std::size_t node, Inbox& inbox);
  void subscribe_arm(Graph& graph, std::size_t node, Inbox& inbox);

  using Left = std::function<void(const std::vector<std::uint64_t>&)>;
  template <class Message, class Value>
  void add(Inbox& inbox, const std::string& topic,
           Inbox::Subscription<Message, Value> subscription);
  using Act =
      std::function<void(const std::optional<std::string>& text, const Origin&, const Done&)>;
  struct Room {
    Graph& graph;
    std::size_t node;
    Inbox& inbox;
  };
  void serve_all(Graph& graph, std::size_t node, Inbox& inbox);
  template <class RequestMessage, class Response>
  void serve(const Room& room, std::string name, const char* type, Act act, Left left);
  Left on_publishers(const std::string& topic, Left left);

  void warn(const std::string& text) const { say_(LogLevel::warning, text); }
  bool is_stale(const std::string& what, const Origin& origin);
  bool is_overtaken(const Origin& origin) const { return origin.written <= stopped_; }
  std::string objection_to(const Command& command) const;
  void on_text(const std::string& text, const void* source, const Origin& origin);
  void want(const Command& command, const void* source, const Origin& origin);
  void post_wanted();
  void post(std::size_t first, std::size_t count);
  void tell(const std::string& what, PostResult result);
  // True if this host has no control. Reports the lost command, because it is not kept for later.
  bool is_without_link(const std::string& what, const Done& done) const;
  static AsyncBoard::Duration left_of(const Origin& origin);
  void stop(Done done);
  void repeat_stop();
  void clear(const Origin& origin, Done done);
  void send(const std::optional<std::string>& text, const void* source, const Origin& origin,
            const Done& done);

  AsyncBoard& board_;
  Outbox& outbox_;
  const NodeOptions options_;
  const Say say_;
  Drivers drivers_;
  std::vector<Setpoint> wanted_;
  std::size_t others_ = 0;  // commands since the last flush() that drive no output
  bool resting_ = false;    // a stop of outputs without a publisher is being sent
  bool arming_ = false;
  asio::cancellation_signal give_up_arming_;
  std::vector<Done> stops_;
  bool stopping_ = false;
  Clock::time_point stopped_{};  // newest stop: an arm or E:CLEAR written before it is refused
  Pressed pressed_;              // on `arm`
  std::uint64_t stale_ = 0;
  std::uint64_t dropped_ = 0;
  std::vector<std::unique_ptr<int>> sources_;  // each address identifies a topic
};

template <class Message, class Value>
void BoardCommands::add(Inbox& inbox, const std::string& topic,
                        Inbox::Subscription<Message, Value> subscription) {
  subscription.left = on_publishers(topic, std::move(subscription.left));
  inbox.add(std::move(subscription));
}

}  // namespace r4::tool::ros2
