// SPDX-License-Identifier: GPL-3.0-or-later
#include "udp_carrier.hpp"

#include <fmt/core.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <asio/ip/udp.hpp>
#include <asio/ip/v6_only.hpp>
#include <asio/post.hpp>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <utility>

#include "../protocol/datagram.hpp"
#include "framing/peer_table.hpp"
#include "operation_slot.hpp"
#include "send_queue.hpp"
#include "udp_host_socket.hpp"
#include "writable_wait.hpp"

namespace r4 {
namespace {

using asio::ip::udp;
using Endpoint = udp::endpoint;

constexpr std::uint16_t board_port = 2018;
constexpr std::uint16_t host_port = 2390;
constexpr std::size_t normal_entries = 64;
constexpr std::size_t state_entries = 4;
constexpr int peer_places = 16;
constexpr std::chrono::milliseconds probe_interval{200};
constexpr char network_fix[] = "check the WiFi or cable and the address";

// The network is not there at the moment, as against one packet that failed.
bool is_network_loss(int error) {
  return error == ENETUNREACH || error == ENETDOWN || error == EHOSTUNREACH ||
         error == EADDRNOTAVAIL || error == ENODEV;
}

asio::ip::address mapped_to_v6(const asio::ip::address& address) {
  return asio::ip::make_address_v6(asio::ip::v4_mapped, address.to_v4());
}

// IPv4 first, as the board's WiFi has it.
Endpoint look_up(asio::io_context& io, const std::string& thing, const std::string& host,
                 std::uint16_t port) {
  asio::error_code error;
  const auto found =
      udp::resolver(io).resolve(host, std::to_string(port), udp::resolver::numeric_service, error);
  if (error || found.empty()) {
    throw Error(ErrorKind::open, thing,
                fmt::format("there is no host '{}' ({})", host, error.message()),
                "check the name, or give the IP address");
  }
  Endpoint endpoint = found.begin()->endpoint();
  for (const auto& result : found) {
    if (endpoint.protocol() != udp::v4()) endpoint = result.endpoint();
  }
  const asio::ip::address address = endpoint.address();
  if (address.is_multicast() || address == asio::ip::address_v4::broadcast()) {
    throw Error(ErrorKind::usage, thing, host + " is the address of many, not of one",
                "give the IP address of the board itself");
  }
  return endpoint;
}

// 0 if the system knows a way to that address, else errno. Sends nothing.
int probe_route(const Endpoint& to) {
  const int probe = ::socket(to.protocol().family(), SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (probe < 0) return errno;
  const int error = ::connect(probe, to.data(), static_cast<socklen_t>(to.size())) == 0 ? 0 : errno;
  ::close(probe);
  return error;
}

// 0 if the system has taken it, else errno.
int send_packet(int socket, std::string_view bytes, const Endpoint& to) {
  ssize_t sent = 0;
  do {
    sent = ::sendto(socket, bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL, to.data(),
                    static_cast<socklen_t>(to.size()));
  } while (sent < 0 && errno == EINTR);
  return sent >= 0 ? 0 : errno;
}

class UdpCarrier final : public Carrier {
 public:
  UdpCarrier(asio::io_context& io, Url url, Role role);
  ~UdpCarrier() override { close(); }

  void open(Handler& handler) override;
  void close() noexcept override;
  SendResult send(std::string_view bytes, Priority priority, Peer to) override;
  void hold(Peer peer) override;
  bool up() const override { return up_; }
  std::size_t max_size() const override { return max_datagram; }
  const std::string& name() const override { return name_; }
  const CarrierCounters& counters() const override { return counters_; }

 private:
  enum class Outcome { sent, busy, failed };

  void bind(const Endpoint& local);
  bool begin_to_receive();
  void received(std::size_t size);
  void follow_audience();
  Outcome transmit(std::string_view bytes, Peer to);
  Outcome transmit_to(std::string_view bytes, const Endpoint& to, bool standing);
  void send_waiting();
  void set_up(bool up);
  void report_later();
  void report();
  void probe_later();

  asio::io_context& io_;
  const Url url_;
  const Role role_;
  std::uint16_t port_;    // of the board
  std::uint16_t listen_;  // of the host
  std::string peer_host_;
  std::uint16_t peer_port_ = host_port;
  std::string name_;

  UdpSocket socket_;
  UdpHostSocket host_socket_{socket_};
  OperationSlot reception_;
  WritableWait writable_;
  LoopTimer probe_timer_;
  OperationSlot probe_;

  Handler* handler_ = nullptr;
  bool up_ = false;
  bool reported_up_ = false;
  int down_error_ = 0;
  int refused_error_ = 0;  // why the system refused the last packet; 0 once one has passed
  int reported_refusal_ = 0;
  OperationSlot reporting_;
  bool standing_known_ = false;
  Endpoint standing_;  // where what is for everyone goes
  PeerTable<Endpoint, peer_places> peers_;
  CarrierCounters counters_;
  SendQueue queue_;

  std::array<char, max_datagram> received_;
  Endpoint sender_;
};

UdpCarrier::UdpCarrier(asio::io_context& io, Url url, Role role)
    : io_(io),
      url_(std::move(url)),
      role_(role),
      port_(url_.port().value_or(board_port)),
      listen_(static_cast<std::uint16_t>(url_.get_number("listen", 0, 65535, host_port))),
      socket_(io),
      writable_(io),
      probe_timer_(io),
      queue_(normal_entries, state_entries, counters_.tx_dropped) {
  if (url_.host().empty() || !url_.path().empty()) {
    throw Error(ErrorKind::usage, url_.text(), "it is not udp://HOST or udp://HOST:PORT",
                "write it as in udp://192.168.1.77:2018");
  }
  if (role == Role::host) {
    url_.allow_only("listen");
    if (port_ == 0) {
      throw Error(ErrorKind::usage, url_.text(), "port 0 is no board's", "the board's is 2018");
    }
  } else {
    url_.allow_only("peer");
    if (const auto peer = url_.get("peer")) {
      const Url parsed = Url::parse("udp://" + *peer);
      peer_host_ = parsed.host();
      peer_port_ = parsed.port().value_or(host_port);
      if (peer_host_.empty() || peer_port_ == 0 || !parsed.path().empty()) {
        throw Error(ErrorKind::usage, url_.text(), "'peer=" + *peer + "' is not HOST or HOST:PORT",
                    "write it as in peer=192.168.1.10:2390");
      }
    }
  }
  name_ = url_.text();
}

void UdpCarrier::open(Handler& handler) {
  close();
  const Endpoint url_endpoint = look_up(io_, url_.text(), url_.host(), port_);
  if (role_ == Role::host) {
    standing_ = url_endpoint;
    if (const int error = probe_route(standing_); error != 0) {
      throw Error(ErrorKind::open, url_.text(), std::strerror(error), network_fix);
    }
    bind(Endpoint(standing_.protocol(), listen_));
    standing_known_ = true;
  } else {
    standing_known_ = false;
    if (!peer_host_.empty()) {
      standing_ = look_up(io_, url_.text(), peer_host_, peer_port_);
      const bool v6_socket = url_endpoint.protocol() == udp::v6();
      if (v6_socket && standing_.protocol() == udp::v4()) {
        standing_.address(mapped_to_v6(standing_.address()));
      } else if (!v6_socket && standing_.protocol() == udp::v6()) {
        throw Error(ErrorKind::usage, url_.text(), "an IPv4 socket cannot send to an IPv6 peer",
                    "listen on [::]");
      }
      standing_known_ = true;
    }
    bind(url_endpoint);
  }
  const std::uint16_t local_port = socket_.local_endpoint().port();
  const std::string host =
      url_.host().find(':') == std::string::npos ? url_.host() : "[" + url_.host() + "]";
  if (role_ == Role::host) {
    name_ = fmt::format("udp://{}:{}", host, port_);
    if (local_port != host_port) name_ += fmt::format("?listen={}", local_port);
  } else {
    name_ = fmt::format("udp://{}:{}", host, local_port);
    if (const auto peer = url_.get("peer")) name_ += "?peer=" + *peer;
  }
  handler_ = &handler;
  begin_to_receive();
  set_up(true);
  report();
}

void UdpCarrier::bind(const Endpoint& local) {
  asio::error_code error;
  socket_.open(local.protocol(), error);
  if (!error && local.protocol() == udp::v6()) {
    socket_.set_option(asio::ip::v6_only(role_ == Role::host), error);
  }
  if (!error) socket_.native_non_blocking(true, error);
  if (!error && role_ == Role::board) socket_.bind(local, error);
  if (!error && role_ == Role::host) error = host_socket_.bind(local.port(), standing_);
  if (!error) return;

  host_socket_.close();
  if (error == asio::error::already_open) {
    throw Error(ErrorKind::open, url_.text(), "this program has that board open already",
                "use the one that is open, or ?listen=0 for another host to the board");
  }
  const std::string port = fmt::format("UDP port {}", local.port());
  if (error == asio::error::address_in_use) {
    throw Error(ErrorKind::open, url_.text(), port + " is in use by another program",
                role_ == Role::host
                    ? "end that program, or use ?listen=0 to hear the board on any free port"
                    : "end that program, or listen on another port");
  }
  if (error == asio::error::access_denied) {
    throw Error(ErrorKind::permission, url_.text(), port + " may not be opened: permission denied",
                "use a port from 1024 up");
  }
  throw Error(ErrorKind::open, url_.text(),
              fmt::format("{} cannot be opened on {}: {}", port, local.address().to_string(),
                          error.message()),
              "use an address of this machine, or 0.0.0.0 for all of them");
}

void UdpCarrier::close() noexcept {
  handler_ = nullptr;
  up_ = reported_up_ = false;
  refused_error_ = reported_refusal_ = 0;
  reporting_.cancel();
  reception_.cancel();
  probe_.cancel();
  writable_.stop();
  queue_.clear();
  host_socket_.close();
}

// The attempt to receive at once with which Asio begins tells whether more is there, at no cost: it
// fills in the sender.
bool UdpCarrier::begin_to_receive() {
  sender_.port(0);
  socket_.async_receive_from(asio::buffer(received_), sender_, MSG_TRUNC,
                             reception_.handler([this](asio::error_code error, std::size_t size) {
                               if (!error) received(size);
                               if (handler_ == nullptr) return;
                               const bool more = begin_to_receive();
                               if (!more) handler_->on_drained();
                             }));
  return sender_.port() != 0;
}

void UdpCarrier::received(std::size_t size) {
  if (role_ == Role::host && !host_socket_.hears(sender_)) {
    ++counters_.rx_foreign;
    return;
  }
  if (size > max_datagram) {
    ++counters_.rx_oversize;
    return;
  }
  Peer peer = everyone;
  if (role_ == Role::board) {
    peer = peers_.heard(sender_, Text(received_.data(), size));
    follow_audience();
  }
  ++counters_.rx_datagrams;
  counters_.rx_bytes += size;
  handler_->on_datagram({received_.data(), size}, peer);
}

void UdpCarrier::hold(Peer peer) {
  peers_.hold(peer);
  follow_audience();
}

void UdpCarrier::follow_audience() {
  const Endpoint* const audience = peers_.find(peers_.audience());
  if (audience == nullptr || !peer_host_.empty()) return;
  standing_ = *audience;
  standing_known_ = true;
}

SendResult UdpCarrier::send(std::string_view bytes, Priority priority, Peer to) {
  if (handler_ == nullptr) return SendResult::down;
  if (bytes.size() > max_datagram) {
    ++counters_.tx_errors;
    return SendResult::full;
  }
  if (queue_.empty()) {
    switch (transmit(bytes, to)) {
      case Outcome::sent:
        return SendResult::sent;
      case Outcome::failed:
        return SendResult::down;
      case Outcome::busy:
        break;
    }
  }
  const SendResult result = queue_.push(bytes, priority, to, std::chrono::steady_clock::now());
  writable_.start(socket_.native_handle(), [this] { send_waiting(); });
  return result;
}

void UdpCarrier::send_waiting() {
  while (const SendQueue::Entry* entry = queue_.front(std::chrono::steady_clock::now())) {
    if (transmit(entry->text(), entry->to) == Outcome::busy) {
      writable_.start(socket_.native_handle(), [this] { send_waiting(); });
      return;
    }
    queue_.pop();
  }
  writable_.stop();
}

UdpCarrier::Outcome UdpCarrier::transmit(std::string_view bytes, Peer to) {
  if (to == everyone) {
    if (standing_known_) return transmit_to(bytes, standing_, true);
    ++counters_.tx_dropped;
    return Outcome::failed;
  }
  const Endpoint* const asker = peers_.find(to);
  if (asker == nullptr) {
    ++counters_.tx_dropped;
    return Outcome::failed;
  }
  const Outcome outcome = transmit_to(bytes, *asker, false);
  if (outcome == Outcome::busy) return outcome;
  const bool same_machine = !peer_host_.empty() && asker->address() == standing_.address();
  if (same_machine && asker->port() != standing_.port()) return transmit_to(bytes, standing_, true);
  return outcome;
}

UdpCarrier::Outcome UdpCarrier::transmit_to(std::string_view bytes, const Endpoint& to,
                                            bool standing) {
  int error = send_packet(socket_.native_handle(), bytes, to);
  // That is about an earlier packet, no program listens there yet; this one was not sent for it.
  if (error == ECONNREFUSED) error = send_packet(socket_.native_handle(), bytes, to);
  if (error == 0 || error == ECONNREFUSED) {
    ++counters_.tx_datagrams;
    counters_.tx_bytes += bytes.size();
    refused_error_ = 0;
    if (!up_) {
      set_up(true);
      report_later();
    }
    return Outcome::sent;
  }
  if (error == EAGAIN || error == EWOULDBLOCK) return Outcome::busy;
  if (error == ENOBUFS) {  // the interface's queue is full; there is nothing to wait for
    ++counters_.tx_dropped;
    return Outcome::sent;
  }
  ++counters_.tx_errors;
  if (!is_network_loss(error)) {
    refused_error_ = error;
    report_later();
  } else if (standing && up_) {
    down_error_ = error;
    set_up(false);
    probe_later();
    report_later();
  }
  return Outcome::failed;
}

void UdpCarrier::set_up(bool up) {
  up_ = up;
  ++(up ? counters_.ups : counters_.downs);
  probe_.cancel();
}

void UdpCarrier::report_later() {
  asio::post(io_, reporting_.handler([this] { report(); }));
}

void UdpCarrier::report() {
  if (refused_error_ != reported_refusal_) {
    reported_refusal_ = refused_error_;
    if (refused_error_ != 0) {
      handler_->on_carrier_event(
          {CarrierEvent::Kind::warning,
           Problem{ErrorKind::open, name_,
                   fmt::format("the system does not send: {}", std::strerror(refused_error_)),
                   refused_error_ == EPERM ? "let UDP to this address through the firewall" : ""}});
    }
  }
  if (handler_ == nullptr || up_ == reported_up_) return;
  reported_up_ = up_;
  if (up_) {
    handler_->on_carrier_event({CarrierEvent::Kind::up, Problem{ErrorKind::open, name_, "", ""}});
  } else {
    handler_->on_carrier_event(
        {CarrierEvent::Kind::down,
         Problem{ErrorKind::open, name_, std::strerror(down_error_), network_fix}});
  }
}

// The interface may come back while nobody sends.
void UdpCarrier::probe_later() {
  probe_timer_.expires_after(probe_interval);
  probe_timer_.async_wait(probe_.handler([this] {
    const int error = host_socket_.connected() ? host_socket_.reconnect() : probe_route(standing_);
    if (error == 0) {
      set_up(true);
      report();
    } else {
      probe_later();
    }
  }));
}

}  // namespace

std::unique_ptr<Carrier> make_udp_carrier(asio::io_context& io, const Url& url, Role role) {
  return std::make_unique<UdpCarrier>(io, url, role);
}

}  // namespace r4
