// SPDX-License-Identifier: GPL-3.0-or-later
// For server.cpp only, which compiles Boost.Beast. Beast uses Boost.Asio, and the boards' loop uses
// standalone Asio. No source can include both, so the server and the loop exchange closures.
#pragma once

#include <array>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <thread>

#include "page_files.hpp"
#include "server.hpp"

namespace r4::tool::web {

namespace net = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using boost::system::error_code;
using net::ip::tcp;
using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr auto header_time = 5s;
constexpr std::string_view page_protocol = "r4.web.v1";
// Names of one protocol: of older servers, and of Foxglove's SDK.
constexpr std::array<std::string_view, 2> foxglove_protocols{"foxglove.websocket.v1",
                                                             "foxglove.sdk.v1"};
using Request = http::request<http::empty_body>;

struct Server::Impl {
  class Client;
  class Exchange;

  Impl(const ServerOptions& options, ServerEvents& server_events)
      : events(server_events),
        page(options.page),
        access(options.address.host, options.hosts, options.token, options.origins),
        folder(options.page_folder),
        files(page ? page_files() : PageFiles()),
        listen_address(options.address) {}

  void listen();
  void accept();
  void ask_metrics(Exchange& exchange);
  void answer_metrics() const;

  ServerEvents& events;
  const bool page;
  const Access access;
  const std::string folder;
  const PageFiles files;
  ListenAddress listen_address;
  net::io_context io{1};
  tcp::acceptor acceptor{io};
  net::steady_timer retry{io};
  std::map<ClientId, std::shared_ptr<Client>> clients;
  std::map<std::uint32_t, std::shared_ptr<Exchange>> exchanges;
  std::uint32_t next_number = 1;
  std::string metrics;
  Clock::time_point metrics_made{};
  bool metrics_asked = false;
  std::thread thread;
};

}  // namespace r4::tool::web
