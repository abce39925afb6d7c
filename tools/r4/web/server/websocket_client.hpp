// SPDX-License-Identifier: GPL-3.0-or-later
// One WebSocket of a browser or of Foxglove; included by server.cpp only.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "server_impl.hpp"

namespace r4::tool::web {

// If a write takes longer, the client is dropped.
constexpr auto stall_time = 10s;
constexpr auto idle_time = 20s;

class Allowance {
 public:
  bool take() {
    const Clock::time_point now = Clock::now();
    const double gained =
        std::chrono::duration<double>(now - last_).count() * Server::messages_a_second;
    left_ = std::min(Server::message_burst, left_ + gained);
    last_ = now;
    if (left_ < 1) return false;
    left_ -= 1;
    return true;
  }

 private:
  double left_ = Server::message_burst;
  Clock::time_point last_ = Clock::now();
};

class Server::Impl::Client : public std::enable_shared_from_this<Client> {
 public:
  // `name` is the subprotocol that the client requested.
  Client(Impl& server, beast::tcp_stream&& stream, ClientId id, Protocol spoken,
         std::string_view name)
      : protocol(spoken), server_(server), id_(id), name_(name), stream_(std::move(stream)) {
    stream_.set_option({header_time, idle_time, true});
    stream_.read_message_max(most_message_bytes);
    stream_.auto_fragment(false);
    stream_.control_callback([this](websocket::frame_type kind, beast::string_view) {
      if (kind == websocket::frame_type::ping && !allowance_.take()) end();
    });
  }

  void accept(const Request& request) {
    stream_.set_option(
        websocket::stream_base::decorator([this](websocket::response_type& response) {
          response.set(http::field::server, "r4");
          response.set(http::field::sec_websocket_protocol,
                       beast::string_view(name_.data(), name_.size()));
        }));
    stream_.async_accept(request, [self = shared_from_this()](error_code error) {
      if (error) return self->end();
      self->open_ = true;
      self->server_.events.on_open(self->id_, self->protocol);
      self->read();
      self->write();
    });
  }

  // Broadcasts begin after the first message for this client alone.
  void send_with_all(const Outgoing& message) {
    if (greeted_) send(message);
  }

  void send(Outgoing message) {
    if (ending_) return;
    greeted_ = true;
    const Clock::time_point now = Clock::now();
    const bool stalled = writing_ && now - writing_since_ > stall_time;
    if (stalled || !queue_.push(std::move(message), now)) return end();
    write();
  }

  void read() {
    if (ending_) return;
    stream_.async_read(buffer_, [self = shared_from_this()](error_code error, std::size_t) {
      if (error) return self->end();
      self->on_read();
    });
  }

  void drop(const std::string& why) {
    if (ending_) return;
    ending_ = true;
    websocket::close_reason reason(websocket::close_code::policy_error);
    reason.reason.assign(why.data(), std::min<std::size_t>(why.size(), 120));
    stream_.async_close(reason, [self = shared_from_this()](error_code) { self->end(); });
  }

  // Closes immediately, without a closing handshake.
  void end() {
    ending_ = true;
    error_code ignored;
    beast::get_lowest_layer(stream_).socket().close(ignored);
    if (server_.clients.erase(id_) != 0 && open_) server_.events.on_closed(id_, protocol);
  }

  const Protocol protocol;

 private:
  void on_read() {
    std::string text = beast::buffers_to_string(buffer_.data());
    buffer_.consume(buffer_.size());
    if (!stream_.got_text() && protocol == Protocol::page) return drop("messages are text");
    if (!allowance_.take()) return drop("too many messages");
    server_.events.on_message(id_, protocol, std::move(text));
  }

  void write() {
    if (writing_ || ending_ || !open_) return;
    if (const std::uint64_t lost = queue_.take_lost(); lost != 0 && protocol == Protocol::page) {
      current_ = {std::make_shared<const std::string>(
                      fmt::format(R"({{"type":"lost","messages":{}}})", lost)),
                  "", Outgoing::Kind::other};
    } else if (std::optional<Outgoing> next = queue_.pop()) {
      current_ = std::move(*next);
    } else {
      return;
    }
    writing_ = true;
    writing_since_ = Clock::now();
    stream_.text(current_.head.empty());
    const std::array<net::const_buffer, 2> parts{net::buffer(current_.head),
                                                 net::buffer(*current_.body)};
    stream_.async_write(parts, [self = shared_from_this()](error_code error, std::size_t) {
      self->writing_ = false;
      self->current_ = {};
      if (error) return self->end();
      self->write();
    });
  }

  Impl& server_;
  const ClientId id_;
  const std::string_view name_;
  websocket::stream<beast::tcp_stream> stream_;
  beast::flat_buffer buffer_{most_message_bytes + 1024};
  ClientQueue queue_;
  Outgoing current_;
  Allowance allowance_;
  Clock::time_point writing_since_{};
  bool writing_ = false;
  bool open_ = false;
  bool greeted_ = false;
  bool ending_ = false;
};

}  // namespace r4::tool::web
