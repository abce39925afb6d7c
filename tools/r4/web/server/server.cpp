// SPDX-License-Identifier: GPL-3.0-or-later
#include "server.hpp"

#include <fcntl.h>

#include <boost/asio/dispatch.hpp>
#include <boost/asio/post.hpp>
#include <filesystem>
#include <utility>

#include "http_exchange.hpp"
#include "r4link/error.hpp"
#include "server_impl.hpp"
#include "websocket_client.hpp"

namespace r4::tool::web {
namespace {

// Small, because data in the kernel cannot be replaced by newer states.
constexpr int send_buffer = 64 << 10;

// Otherwise a child process would keep the port open.
void close_on_exec(int descriptor) { ::fcntl(descriptor, F_SETFD, FD_CLOEXEC); }

}  // namespace

void Server::Impl::listen() {
  const std::string name = "--listen " + listen_address.text();
  error_code error;
  tcp::resolver resolver(io);
  const auto found =
      resolver.resolve(listen_address.host, std::to_string(listen_address.port), error);
  if (error || found.empty()) {
    throw Error(ErrorKind::open, name, "is not an address of this computer",
                "use an address that `ip address` shows");
  }
  const tcp::endpoint endpoint = found.begin()->endpoint();
  acceptor.open(endpoint.protocol(), error);
  if (!error) close_on_exec(acceptor.native_handle());
  if (!error) acceptor.set_option(tcp::acceptor::reuse_address(true), error);
  if (!error) acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(net::socket_base::max_listen_connections, error);
  if (error == net::error::address_in_use) {
    throw Error(ErrorKind::open, name, "another program listens at this address",
                "end that program, or give another port; port 0 selects a free port");
  }
  if (error == net::error::access_denied) {
    throw Error(ErrorKind::permission, name, "only root may use ports below 1024",
                "give a higher port, such as 8080");
  }
  if (error) {
    throw Error(ErrorKind::open, name, error.message(), "use an address that `ip address` shows");
  }
  listen_address.port = acceptor.local_endpoint().port();
}

void Server::Impl::accept() {
  acceptor.async_accept([this](error_code error, tcp::socket socket) {
    if (error == net::error::operation_aborted) return;
    if (error) {  // for example too many open files: wait until some are closed
      retry.expires_after(100ms);
      retry.async_wait([this](error_code cancelled) {
        if (!cancelled) accept();
      });
      return;
    }
    close_on_exec(socket.native_handle());
    error_code ignored;
    socket.set_option(tcp::no_delay(true), ignored);
    socket.set_option(net::socket_base::send_buffer_size(send_buffer), ignored);
    // A new connection replaces the oldest unfinished request.
    if (exchanges.size() >= most_requests) exchanges.begin()->second->end();
    const std::uint32_t number = next_number++;
    const auto exchange = std::make_shared<Exchange>(*this, std::move(socket), number);
    exchanges.emplace(number, exchange);
    exchange->read();
    accept();
  });
}

void Server::Impl::ask_metrics(Exchange& exchange) {
  if (metrics_made + metrics_age > Clock::now() && !metrics.empty()) {
    return exchange.answer_metrics(metrics);
  }
  exchange.wait_for_metrics();
  if (std::exchange(metrics_asked, true)) return;
  events.on_metrics();
}

void Server::Impl::answer_metrics() const {
  const auto all = exchanges;  // a copy, because an exchange may end meanwhile
  for (const auto& [number, exchange] : all) {
    if (exchange->waits_for_metrics()) exchange->answer_metrics(metrics);
  }
}

Server::Server(const ServerOptions& options, ServerEvents& events)
    : impl_(std::make_unique<Impl>(options, events)) {
  if (!options.page_folder.empty() && !std::filesystem::is_directory(options.page_folder)) {
    throw Error(ErrorKind::open, "--page " + options.page_folder, "is not a folder",
                "give the folder of the page's files, such as tools/r4/web/page");
  }
  impl_->listen();
}

Server::~Server() {
  impl_->io.stop();
  if (impl_->thread.joinable()) impl_->thread.join();
}

void Server::start() {
  impl_->accept();
  impl_->thread = std::thread([this] { impl_->io.run(); });
}

const ListenAddress& Server::address() const { return impl_->listen_address; }

void Server::run(std::function<void()> task) { net::post(impl_->io, std::move(task)); }

void Server::send(ClientId client, Outgoing message) {
  net::dispatch(impl_->io, [this, client, message = std::move(message)]() mutable {
    const auto found = impl_->clients.find(client);
    if (found == impl_->clients.end()) return;
    const std::shared_ptr<Impl::Client> alive = found->second;
    alive->send(std::move(message));
  });
}

void Server::broadcast(Protocol protocol, Outgoing message) {
  net::dispatch(impl_->io, [this, protocol, message = std::move(message)] {
    const auto all = impl_->clients;  // a copy, because a client may end meanwhile
    for (const auto& [id, client] : all) {
      if (client->protocol == protocol) client->send_with_all(message);
    }
  });
}

void Server::read_on(ClientId client) {
  net::post(impl_->io, [this, client] {
    const auto found = impl_->clients.find(client);
    if (found != impl_->clients.end()) found->second->read();
  });
}

void Server::drop(ClientId client, std::string why) {
  net::post(impl_->io, [this, client, why = std::move(why)] {
    const auto found = impl_->clients.find(client);
    if (found == impl_->clients.end()) return;
    const std::shared_ptr<Impl::Client> alive = found->second;
    alive->drop(why);
  });
}

void Server::set_metrics(std::string text) {
  net::post(impl_->io, [this, text = std::move(text)]() mutable {
    impl_->metrics = std::move(text);
    impl_->metrics_made = Clock::now();
    impl_->metrics_asked = false;
    impl_->answer_metrics();
  });
}

}  // namespace r4::tool::web
