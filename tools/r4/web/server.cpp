// SPDX-License-Identifier: GPL-3.0-or-later
// The one file that knows Boost.Beast. Its event loop is Boost's, the boards' is that of Asio alone: they meet in
// closures that each hands to the other.
#include "server.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <boost/asio/dispatch.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <thread>
#include <utility>

#include "page_files.hpp"
#include "r4link/error.hpp"

namespace r4::tool::web {
namespace {

namespace net = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using boost::system::error_code;
using net::ip::tcp;
using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr auto header_time = 5s;
constexpr auto answer_time = 10s;
// Nothing has gone out to a client for that long although something waits.
constexpr auto stall_time = 10s;
constexpr auto idle_time = 20s;
constexpr int send_buffer = 128 << 10;
constexpr std::string_view page_protocol = "r4.web.v1";
constexpr std::string_view foxglove_protocol = "foxglove.websocket.v1";
constexpr const char* content_security_policy =
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' "
    "data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

using Request = http::request<http::empty_body>;
using Response = http::response<http::string_body>;

std::string_view view(beast::string_view text) { return {text.data(), text.size()}; }

std::vector<std::string> protocols_of(const Request& request) {
  constexpr std::size_t most = 8;
  std::vector<std::string> all;
  for (const auto& each : http::token_list(request[http::field::sec_websocket_protocol])) {
    if (all.size() == most) break;
    all.emplace_back(each);
  }
  return all;
}

// How many messages a client may still send.
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

}  // namespace

struct Server::Impl {
  class Client;
  class Exchange;

  Impl(const ServerOptions& options, ServerEvents& server_events)
      : events(server_events),
        access(options.address.host, options.token, options.origins),
        folder(options.page_folder),
        files(page_files()),
        listen_address(options.address) {}

  void listen();
  void accept();

  ServerEvents& events;
  const Access access;
  const std::string folder;
  const PageFiles files;
  ListenAddress listen_address;
  net::io_context io{1};
  tcp::acceptor acceptor{io};
  net::steady_timer retry{io};
  std::map<ClientId, std::shared_ptr<Client>> clients;
  std::map<std::uint32_t, std::shared_ptr<Exchange>> exchanges;  // the oldest first
  std::uint32_t next_number = 1;
  std::thread thread;
};

// --- a WebSocket

class Server::Impl::Client : public std::enable_shared_from_this<Client> {
 public:
  Client(Impl& server, beast::tcp_stream&& stream, ClientId id, Protocol spoken)
      : protocol(spoken), server_(server), id_(id), stream_(std::move(stream)) {
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
          const bool page = protocol == Protocol::page;
          const std::string_view name = page ? page_protocol : foxglove_protocol;
          response.set(http::field::server, "r4");
          response.set(http::field::sec_websocket_protocol,
                       beast::string_view(name.data(), name.size()));
        }));
    stream_.async_accept(request, [self = shared_from_this()](error_code error) {
      if (error) return self->end();
      self->open_ = true;
      self->server_.events.on_open(self->id_, self->protocol);
      self->read();
      self->write();
    });
  }

  // What all get comes after the first that is for this one alone.
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

  // At once, without a farewell.
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

// --- HTTP, until it becomes one

class Server::Impl::Exchange : public std::enable_shared_from_this<Exchange> {
 public:
  Exchange(Impl& server, tcp::socket&& socket, std::uint32_t number)
      : server_(server), number_(number), stream_(std::move(socket)) {}

  void read() {
    parser_.emplace();
    parser_->header_limit(most_header_bytes);
    stream_.expires_after(header_time);
    http::async_read(
        stream_, buffer_, *parser_,
        [self = shared_from_this()](error_code error, std::size_t) { self->on_read(error); });
  }

  void answer_metrics(std::string text) {
    Response response = make(http::status::ok, "text/plain; version=0.0.4; charset=utf-8");
    response.set(http::field::cache_control, "no-store");
    response.body() = std::move(text);
    answer(std::move(response));
  }

  void end() {
    error_code ignored;
    stream_.socket().close(ignored);
    server_.exchanges.erase(number_);
  }

 private:
  void on_read(error_code error) {
    if (error == http::error::header_limit || error == http::error::buffer_overflow) {
      return refuse(http::status::request_header_fields_too_large, "the request is too long");
    }
    if (error == http::error::unexpected_body || error == http::error::body_limit) {
      return refuse(http::status::payload_too_large, "nothing is taken here");
    }
    if (error.category() == http::make_error_code(http::error::bad_version).category() &&
        error != http::error::end_of_stream && error != http::error::partial_message) {
      return refuse(http::status::bad_request, "this is no request");
    }
    if (error) return end();
    dispatch();
  }

  void dispatch() {
    const Request& request = parser_->get();
    const auto hosts = request.equal_range(http::field::host);
    const auto origins = request.equal_range(http::field::origin);
    if (std::distance(hosts.first, hosts.second) != 1 ||
        std::distance(origins.first, origins.second) > 1) {
      return refuse(http::status::bad_request, "there must be one Host");
    }
    if (websocket::is_upgrade(request)) return upgrade();
    const std::string_view host = view(request[http::field::host]);
    const std::string_view origin = view(request[http::field::origin]);
    if (const Verdict verdict = server_.access.check(host, origin); verdict != Verdict::allowed) {
      return refuse(http::status::forbidden, to_text(verdict));
    }
    if (request.method() != http::verb::get && request.method() != http::verb::head) {
      return refuse(http::status::method_not_allowed, "only GET and HEAD are known here");
    }
    const std::string_view target = view(request.target());
    const std::string_view path = target.substr(0, target.find('?'));
    if (path != "/metrics") return serve(path == "/" ? "/index.html" : path);
    const Verdict verdict =
        server_.access.check_token(view(request[http::field::authorization]), target, {});
    if (verdict != Verdict::allowed) return refuse(http::status::unauthorized, to_text(verdict));
    stream_.expires_after(answer_time);
    server_.events.on_metrics(number_);
  }

  void upgrade() {
    const Request& request = parser_->get();
    const std::vector<std::string> protocols = protocols_of(request);
    const auto asks_for = [&protocols](std::string_view name) {
      return std::find(protocols.begin(), protocols.end(), name) != protocols.end();
    };
    const std::string_view target = view(request.target());
    const std::string_view path = target.substr(0, target.find('?'));
    const bool page = path == "/live" && asks_for(page_protocol);
    const bool foxglove = !page && asks_for(foxglove_protocol);
    if (!page && !foxglove) {
      return refuse(http::status::bad_request,
                    "the subprotocol r4.web.v1 is at /live, foxglove.websocket.v1 anywhere");
    }
    const std::string_view host = view(request[http::field::host]);
    const std::string_view origin = view(request[http::field::origin]);
    Verdict verdict =
        page ? server_.access.check(host, origin) : server_.access.check_reader(host, origin);
    if (verdict != Verdict::allowed) return refuse(http::status::forbidden, to_text(verdict));
    verdict =
        server_.access.check_token(view(request[http::field::authorization]), target, protocols);
    if (verdict != Verdict::allowed) return refuse(http::status::unauthorized, to_text(verdict));
    if (server_.clients.size() >= most_clients) {
      return refuse(http::status::service_unavailable,
                    "64 clients are here already, as many as may");
    }
    stream_.expires_never();
    const ClientId id = server_.next_number++;
    const auto client = std::make_shared<Client>(server_, std::move(stream_), id,
                                                 page ? Protocol::page : Protocol::foxglove);
    server_.clients.emplace(id, client);
    client->accept(request);
    server_.exchanges.erase(number_);
  }

  void serve(std::string_view path) {
    PageFile changed;
    const auto found = server_.files.find(path);
    const PageFile* file = found == server_.files.end() ? nullptr : &found->second;
    if (!server_.folder.empty() && path.find('/', 1) == std::string_view::npos &&
        !path.starts_with("/.")) {
      std::ifstream in(server_.folder + std::string(path), std::ios::binary);
      if (in) {
        const std::string content{std::istreambuf_iterator<char>(in), {}};
        changed = page_file(path, content);
        file = &changed;
      }
    }
    if (file == nullptr) return refuse(http::status::not_found, "there is nothing here");
    const Request& request = parser_->get();
    const bool same = view(request[http::field::if_none_match]) == file->etag;
    Response response = make(same ? http::status::not_modified : http::status::ok, file->type);
    response.set(http::field::etag, file->etag);
    response.set(http::field::cache_control, "no-cache");
    response.set(http::field::vary, "Accept-Encoding");
    const bool takes_gzip = http::token_list(request[http::field::accept_encoding]).exists("gzip");
    if (takes_gzip && !same) response.set(http::field::content_encoding, "gzip");
    if (!same) response.body() = takes_gzip ? file->gzip : file->content;
    answer(std::move(response));
  }

  Response make(http::status status, const std::string& type) const {
    Response response(status, 11);
    response.set(http::field::content_type, type);
    response.set("Content-Security-Policy", content_security_policy);
    response.set("X-Content-Type-Options", "nosniff");
    response.set("Referrer-Policy", "no-referrer");
    response.set("Cross-Origin-Resource-Policy", "same-origin");
    response.keep_alive(parser_ && parser_->is_header_done() && parser_->get().keep_alive());
    return response;
  }

  void refuse(http::status status, const char* why) {
    Response response = make(status, "text/plain; charset=utf-8");
    response.keep_alive(false);
    if (status == http::status::method_not_allowed) response.set(http::field::allow, "GET, HEAD");
    response.body() = std::string("r4 web: ") + why + "\n";
    answer(std::move(response));
  }

  void answer(Response response) {
    response.prepare_payload();
    if (parser_->is_header_done() && parser_->get().method() == http::verb::head) {
      response.body().clear();
    }
    response_.emplace(std::move(response));
    stream_.expires_after(answer_time);
    serializer_.emplace(*response_);
    http::async_write(stream_, *serializer_,
                      [self = shared_from_this()](error_code error, std::size_t) {
                        if (error || !self->response_->keep_alive()) return self->end();
                        self->read();
                      });
  }

  Impl& server_;
  const std::uint32_t number_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_{most_header_bytes};
  std::optional<http::request_parser<http::empty_body>> parser_;
  std::optional<Response> response_;
  std::optional<http::response_serializer<http::string_body>> serializer_;
};

// --- the server

void Server::Impl::listen() {
  const std::string name = "--listen " + listen_address.text();
  error_code error;
  tcp::resolver resolver(io);
  const auto found =
      resolver.resolve(listen_address.host, std::to_string(listen_address.port), error);
  if (error || found.empty()) {
    throw Error(ErrorKind::open, name, "is no address of this computer",
                "ip address shows which there are");
  }
  const tcp::endpoint endpoint = found.begin()->endpoint();
  acceptor.open(endpoint.protocol(), error);
  if (!error) acceptor.set_option(tcp::acceptor::reuse_address(true), error);
  if (!error) acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(net::socket_base::max_listen_connections, error);
  if (error == net::error::address_in_use) {
    throw Error(ErrorKind::open, name, "another program listens there",
                "end it, or name another port; with port 0 a free one is taken");
  }
  if (error == net::error::access_denied) {
    throw Error(ErrorKind::permission, name, "ports below 1024 are root's",
                "take one above, such as 8080");
  }
  if (error) {
    throw Error(ErrorKind::open, name, error.message(),
                "ip address shows the addresses of this computer");
  }
  listen_address.port = acceptor.local_endpoint().port();
}

void Server::Impl::accept() {
  acceptor.async_accept([this](error_code error, tcp::socket socket) {
    if (error == net::error::operation_aborted) return;
    if (error) {  // out of files, for one: those that end give some back
      retry.expires_after(100ms);
      retry.async_wait([this](error_code cancelled) {
        if (!cancelled) accept();
      });
      return;
    }
    error_code ignored;
    socket.set_option(tcp::no_delay(true), ignored);
    socket.set_option(net::socket_base::send_buffer_size(send_buffer), ignored);
    // Who comes is served; who has kept a place for longest without getting on gives it up.
    if (exchanges.size() >= most_requests) exchanges.begin()->second->end();
    const std::uint32_t number = next_number++;
    const auto exchange = std::make_shared<Exchange>(*this, std::move(socket), number);
    exchanges.emplace(number, exchange);
    exchange->read();
    accept();
  });
}

Server::Server(const ServerOptions& options, ServerEvents& events)
    : impl_(std::make_unique<Impl>(options, events)) {
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
    const auto all = impl_->clients;  // one may end meanwhile
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

void Server::answer_metrics(std::uint32_t request, std::string text) {
  net::post(impl_->io, [this, request, text = std::move(text)]() mutable {
    const auto found = impl_->exchanges.find(request);
    if (found != impl_->exchanges.end()) found->second->answer_metrics(std::move(text));
  });
}

}  // namespace r4::tool::web
