// SPDX-License-Identifier: GPL-3.0-or-later
#include "udp_host.hpp"

#include <fmt/format.h>
#include <sys/socket.h>

#include <algorithm>
#include <utility>

namespace r4 {

UdpHost::UdpHost(asio::io_context& io, const Url& url, Claim claim, HostLookup lookup,
                 BoardSearch search)
    : UdpEnd(io, UdpUrl(url, Role::host)),
      lookup_(std::move(lookup)),
      search_(std::move(search)),
      claim_(std::move(claim)),
      watch_(
          io, lookup_, [this] { return question(); },
          [this](const FoundHost& answer) {
            found(answer);
            return socket_.is_open();
          }),
      network_(NetworkWatch::of(io)) {
  search_.port = url_.port;
}

// In a handler of the loop, the lookup of a name must not block the loop.
void UdpHost::open(Handler& handler) {
  close();
  wanted_ = {url_.called, ""};
  named_ = url_.search || !is_address(url_.host);
  if (named_ && io_.get_executor().running_in_this_thread()) {
    handler_ = &handler;
  } else {
    const FoundHost board = url_.search ? find_board(search_, wanted_) : lookup_.find(url_.host);
    bind(Endpoint(address_of(board, url_.host, url_.text), url_.port));
    wanted_.board_id = board.board_id;
    begin(handler);
    if (handler_ == nullptr) return;
  }
  network_.enter(*this);
  // Without a name, only a connected socket needs a watch, because its own address may change.
  if (named_ || host_socket_.connected()) watch_.start(socket_.is_open());
}

void UdpHost::close() noexcept {
  watch_.stop();
  network_.leave(*this);
  UdpEnd::close();
}

void UdpHost::bind(const Endpoint& board) {
  board_ = board;
  const bool any_port = claim_->yields && !url_.names_listen;
  Endpoint local(board.protocol(), any_port ? std::uint16_t{0} : url_.listen);
  if (!url_.local.is_unspecified()) {
    if (url_.local.is_v6() != board.address().is_v6()) {
      throw Error(ErrorKind::usage, url_.text,
                  fmt::format("{} and the board's address, {}, are not of the same IP version",
                              url_.local.to_string(), board.address().to_string()),
                  "give an address of the board's IP version, IPv4 or IPv6");
    }
    local.address(url_.local);
  }
  const std::vector<OwnAddress> own = own_addresses();
  if (const int error = probe_route(board, url_.local, own); error != 0) {
    throw Error(no_route(url_.text, error));
  }
  open_socket(local, true);
  send_by_interface_of(url_.local, socket_.native_handle(), board, own);
  const asio::error_code error = host_socket_.bind(local, board);
  if (error == asio::error::already_open) {
    close_socket();
    throw Error(ErrorKind::open, url_.text, "this program has already opened that board",
                "use the board that is open, or open a second host with ?listen=0");
  }
  if (error) {
    refuse(error, local,
           "end that program, or use ?listen=0 to receive from the board on any free port");
  }
  const std::uint16_t local_port = socket_.local_endpoint().port();
  const std::string host = url_.search ? board.address().to_string() : url_.host;
  name_ = fmt::format("udp://{}:{}", bracketed(host), url_.port);
  if (local_port != UdpUrl::host_port) name_ += fmt::format("?listen={}", local_port);
  if (url_.local.is_unspecified()) return;
  const char* const joins = local_port != UdpUrl::host_port ? "&" : "?";
  name_ += fmt::format("{}local={}", joins, url_.local.to_string());
}

// The question does not use this object, which may be destroyed before the answer arrives.
HostWatch::Question UdpHost::question() const {
  if (!named_) return nullptr;
  if (url_.search) {
    return [search = search_, wanted = wanted_] { return find_board(search, wanted); };
  }
  return [resolve = lookup_.resolve, host = url_.host] { return resolve(host); };
}

void UdpHost::found(const FoundHost& answer) {
  const auto& addresses = answer.addresses;
  const bool is_open = socket_.is_open();
  if (is_open) {
    const bool same =
        std::find(addresses.begin(), addresses.end(), board_.address()) != addresses.end();
    // The board has not moved. This computer may have moved.
    if (same || addresses.empty()) return check_network(own_addresses());
  }
  const std::string before = is_open ? board_.address().to_string() : "";
  try {
    const Endpoint board(address_of(answer, url_.host, url_.text), url_.port);
    reception_.cancel();
    writable_.stop();
    close_socket();
    bind(board);
  } catch (const Error& error) {
    if (socket_.is_open()) return;
    why_down_ = error.problem();
    set_up(false);
    return report();
  }
  wanted_.board_id = answer.board_id;
  begin(*handler_);
  if (is_open && handler_ != nullptr) {
    warn(fmt::format("the board is at {} now; it was at {}", board_.address().to_string(), before),
         "");
  }
}

// Asio first tries to receive at once. If Asio then sets the sender, the socket held another
// packet, so the socket is not drained.
void UdpHost::listen() {
  sender_.port(0);
  socket_.async_receive_from(asio::buffer(received_), sender_, MSG_TRUNC,
                             reception_.handler([this](asio::error_code error, std::size_t size) {
                               if (!error) received({received_.data(), size});
                               if (handler_ == nullptr) return;
                               listen();
                               if (sender_.port() == 0) handler_->on_drained();
                             }));
}

void UdpHost::received(std::string_view bytes) {
  if (sender_ != board_) {
    ++counters_.rx_foreign;
    return;
  }
  if (bytes.size() > max_datagram) {
    ++counters_.rx_oversize;
    handler_->on_oversize({bytes.data(), max_datagram});  // the buffer holds no more
    return;
  }
  if (watch_.listens()) {
    Datagram datagram;
    if (read_datagram(bytes, datagram)) watch_.heard();
  }
  hand_over(bytes, everyone);
}

int UdpHost::probe(const std::vector<OwnAddress>& own) {
  if (const int error = probe_route(board_, url_.local, own); error != 0) return error;
  // Another interface may have that address now.
  send_by_interface_of(url_.local, socket_.native_handle(), board_, own);
  return host_socket_.reconnect();
}

}  // namespace r4
