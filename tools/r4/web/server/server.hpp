// SPDX-License-Identifier: GPL-3.0-or-later
// The HTTP and WebSocket server of r4 web and r4 metrics, on a thread of its own. It knows nothing of boards. Whatever
// clients do, however many they are, costs a bounded amount of memory and never waits for anything of the caller's.
//
// Each client's next message is read when the caller has dealt with the one before: so no more than one of each waits.
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
  bool page = true;                  // and what is live, besides /metrics
  std::vector<std::string> hosts;    // NAME or NAME:PORT by which it is asked besides the address
  std::string token;                 // empty: none is needed
  std::vector<std::string> origins;  // of foreign pages that may read by the Foxglove protocol
  std::string page_folder;           // the page's files; empty: those in the program
};

// Called on the server's thread.
class ServerEvents {
 public:
  virtual void on_open(ClientId client, Protocol protocol) = 0;
  // A text message. The next one of that client comes after Server::read_on().
  virtual void on_message(ClientId client, Protocol protocol, std::string text) = 0;
  virtual void on_closed(ClientId client, Protocol protocol) = 0;
  // A request for /metrics waits: Server::set_metrics(). Not called again before that, nor within `metrics_age` after it.
  virtual void on_metrics() = 0;

 protected:
  ~ServerEvents() = default;
};

class Server {
 public:
  static constexpr std::size_t most_clients = 64;
  // Of one that waits for its answer, or has not asked yet.
  static constexpr std::size_t most_requests = 64;
  static constexpr std::size_t most_message_bytes = 4096;
  static constexpr std::size_t most_header_bytes = 8192;
  // A client that sends more messages is let go: at once, and then a second.
  static constexpr double message_burst = 400;
  static constexpr double messages_a_second = 200;

  // All who ask for /metrics within that time get the same answer.
  static constexpr std::chrono::milliseconds metrics_age{200};

  // Listens. Throws Error. Clients are served from start() on.
  Server(const ServerOptions& options, ServerEvents& events);
  // Ends the thread: no event follows.
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  void start();
  const ListenAddress& address() const;

  // From any thread; done soon, on the server's. A client that is gone is passed over.
  void send(ClientId client, Outgoing message);
  void broadcast(Protocol protocol, Outgoing message);
  void read_on(ClientId client);
  // Tells it why, and closes its connection.
  void drop(ClientId client, std::string why);
  void set_metrics(std::string text);
  void run(std::function<void()> task);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace r4::tool::web
