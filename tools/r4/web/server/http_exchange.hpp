// SPDX-License-Identifier: GPL-3.0-or-later
// One connection until it becomes a WebSocket; included by server.cpp only.
#pragma once

#include <algorithm>
#include <iterator>
#include <optional>
#include <utility>
#include <vector>

#include "server_impl.hpp"
#include "websocket_client.hpp"

namespace r4::tool::web {

constexpr auto answer_time = 10s;
constexpr const char* content_security_policy =
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' "
    "data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

using Response = http::response<http::string_body>;

inline std::string_view view(beast::string_view text) { return {text.data(), text.size()}; }

inline std::vector<std::string> protocols_of(const Request& request) {
  constexpr std::size_t most = 8;
  std::vector<std::string> all;
  for (const auto& each : http::token_list(request[http::field::sec_websocket_protocol])) {
    if (all.size() == most) break;
    all.emplace_back(each);
  }
  return all;
}

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

  void wait_for_metrics() { waits_for_metrics_ = true; }
  bool waits_for_metrics() const { return waits_for_metrics_; }
  void answer_metrics(std::string text) {
    waits_for_metrics_ = false;
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
      return refuse(http::status::payload_too_large, "this server does not accept a request body");
    }
    if (error.category() == http::make_error_code(http::error::bad_version).category() &&
        error != http::error::end_of_stream && error != http::error::partial_message) {
      return refuse(http::status::bad_request, "this is not a valid request");
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
      return refuse(http::status::bad_request, "the request needs exactly one Host");
    }
    if (websocket::is_upgrade(request) && server_.page) return upgrade();
    const std::string_view host = view(request[http::field::host]);
    const std::string_view origin = view(request[http::field::origin]);
    if (const Verdict verdict = server_.access.check(host, origin); verdict != Verdict::allowed) {
      return refuse(http::status::forbidden, to_text(verdict));
    }
    if (request.method() != http::verb::get && request.method() != http::verb::head) {
      return refuse(http::status::method_not_allowed, "only GET and HEAD are possible");
    }
    const std::string_view target = view(request.target());
    const std::string_view path = target.substr(0, target.find('?'));
    if (!path.starts_with('/')) {
      return refuse(http::status::bad_request, "a path begins with a slash");
    }
    if (path != "/metrics") return serve(path == "/" ? "/index.html" : path);
    const Verdict verdict =
        server_.access.check_token(view(request[http::field::authorization]), target, {});
    if (verdict != Verdict::allowed) return refuse(http::status::unauthorized, to_text(verdict));
    server_.ask_metrics(*this);
  }

  void upgrade() {
    const Request& request = parser_->get();
    const std::vector<std::string> protocols = protocols_of(request);
    const auto asks_for = [&protocols](std::string_view name) {
      return std::find(protocols.begin(), protocols.end(), name) != protocols.end();
    };
    const std::string_view target = view(request.target());
    const std::string_view path = target.substr(0, target.find('?'));
    const bool from_page = path == "/live" && asks_for(page_protocol);
    const auto foxglove =
        std::find_if(foxglove_protocols.begin(), foxglove_protocols.end(), asks_for);
    if (!from_page && foxglove == foxglove_protocols.end()) {
      return refuse(http::status::bad_request,
                    "the subprotocol r4.web.v1 is at /live, foxglove.websocket.v1 anywhere");
    }
    const std::string_view host = view(request[http::field::host]);
    const std::string_view origin = view(request[http::field::origin]);
    Verdict verdict =
        from_page ? server_.access.check(host, origin) : server_.access.check_reader(host, origin);
    if (verdict != Verdict::allowed) return refuse(http::status::forbidden, to_text(verdict));
    verdict =
        server_.access.check_token(view(request[http::field::authorization]), target, protocols);
    if (verdict != Verdict::allowed) return refuse(http::status::unauthorized, to_text(verdict));
    if (server_.clients.size() >= most_clients) {
      return refuse(http::status::service_unavailable,
                    "64 clients are connected already, which is the limit");
    }
    stream_.expires_never();
    const ClientId id = server_.next_number++;
    const auto client = std::make_shared<Client>(server_, std::move(stream_), id,
                                                 from_page ? Protocol::page : Protocol::foxglove,
                                                 from_page ? page_protocol : *foxglove);
    server_.clients.emplace(id, client);
    client->accept(request);
    server_.exchanges.erase(number_);
  }

  void serve(std::string_view path) {
    std::optional<PageFile> changed;
    if (!server_.folder.empty()) changed = page_file_in(server_.folder, path);
    const auto found = server_.files.find(path);
    const PageFile* const file = changed                        ? &*changed
                                 : found != server_.files.end() ? &found->second
                                                                : nullptr;
    if (file == nullptr) return refuse(http::status::not_found, "this page does not exist");
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
    response.body() = std::string("r4: ") + why + "\n";
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
  bool waits_for_metrics_ = false;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_{most_header_bytes};
  std::optional<http::request_parser<http::empty_body>> parser_;
  std::optional<Response> response_;
  std::optional<http::response_serializer<http::string_body>> serializer_;
};

}  // namespace r4::tool::web
