// SPDX-License-Identifier: GPL-3.0-or-later
// The HTTP and WebSocket server of r4 web and r4 metrics, on its own thread, without knowledge of
// boards. Memory is bounded for any clients, and the server never waits for the caller. A client's
// next message is read after read_on(), so at most one waits.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "access.hpp"
#include "client_queue.hpp"

namespace r4::tool::web {

using ClientId = std::uint32_t;
enum class Protocol : std::uint8_t { page, foxglove };

struct ServerOptions {
  ListenAddress address;
  bool page = true;                  // serve the page and live data, not only /metrics
  std::vector<std::string> hosts;    // NAME or NAME:PORT accepted besides the address
  std::string token;                 // empty: not required
  std::vector<std::string> origins;  // foreign pages that may read by the Foxglove protocol
  std::string page_folder;           // files of the page; empty: the embedded files
};

// Called on the server's thread.
class ServerEvents {
 public:
  virtual void on_open(ClientId client, Protocol protocol) = 0;
  virtual void on_message(ClientId client, Protocol protocol, std::string text) = 0;
  virtual void on_closed(ClientId client, Protocol protocol) = 0;
  // Reply by Server::set_metrics(). Not called again until `metrics_age` after the reply.
  virtual void on_metrics() = 0;

 protected:
  ~ServerEvents() = default;
};

class Server {
 public:
  static constexpr std::size_t most_clients = 64;
  // Requests being read or waiting for an answer.
  static constexpr std::size_t most_requests = 64;
  static constexpr std::size_t most_message_bytes = 4096;
  static constexpr std::size_t most_header_bytes = 8192;
  // A client that exceeds these message limits is dropped.
  static constexpr double message_burst = 400;
  static constexpr double messages_a_second = 200;

  static constexpr std::chrono::milliseconds metrics_age{200};

  // Listens. Clients are served after start(). Throws Error.
  Server(const ServerOptions& options, ServerEvents& events);
  // Ends the thread: no event follows.
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  void start();
  const ListenAddress& address() const;

  // Call from any thread. Executed on the server's thread. Unknown clients are ignored.
  void send(ClientId client, Outgoing message);
  void broadcast(Protocol protocol, Outgoing message);
  void read_on(ClientId client);
  void drop(ClientId client, std::string why);
  void set_metrics(std::string text);
  void run(std::function<void()> task);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace r4::tool::web
