// SPDX-License-Identifier: GPL-3.0-or-later
#include "udp_carrier.hpp"

#include <fmt/core.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <asio/ip/udp.hpp>
#include <asio/ip/v6_only.hpp>
#include <asio/post.hpp>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <utility>

#include "../../protocol/datagram/datagram.hpp"
#include "../framing/peer_table.hpp"
#include "host_lookup.hpp"
#include "../operation_slot.hpp"
#include "../send_queue.hpp"
#include "udp_host_socket.hpp"
#include "udp_url.hpp"
#include "../writable_wait.hpp"

namespace r4 {
namespace {

using asio::ip::udp;
using Endpoint = udp::endpoint;

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

std::string bracketed(const std::string& host) {
  return host.find(':') == std::string::npos ? host : "[" + host + "]";
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
  UdpCarrier(asio::io_context& io, const Url& url, Role role, HostLookup lookup);
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

  void open_host();
  void open_board();
  void begin(const Endpoint& board);
  void found(const FoundHost& answer);
  void watch();
  void bind(const Endpoint& local);
  bool begin_to_receive();
  void received(std::size_t size);
  void follow_audience();
  Outcome transmit(std::string_view bytes, Peer to);
  Outcome transmit_to(std::string_view bytes, const Endpoint& to, bool standing);
  void send_waiting();
  void set_up(bool up);
  void warn(const std::string& reason, const std::string& fix);
  void tell_why_down(const Problem& problem);
  void report_later();
  void report();
  void probe_later();

  asio::io_context& io_;
  const UdpUrl url_;
  const Role role_;
  std::string name_;
  const HostLookup lookup_;
  HostWatch watch_;

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
  std::string down_reason_;  // why it cannot be opened, as told last
  bool named_ = false;       // the URL has the board's name, not its address
  bool standing_known_ = false;
  Endpoint standing_;  // where what is for everyone goes
  PeerTable<Endpoint, peer_places> peers_;
  CarrierCounters counters_;
  SendQueue queue_;

  std::array<char, max_datagram> received_;
  Endpoint sender_;
};

UdpCarrier::UdpCarrier(asio::io_context& io, const Url& url, Role role, HostLookup lookup)
    : io_(io),
      url_(url, role),
      role_(role),
      name_(url_.text),
      lookup_(std::move(lookup)),
      watch_(io, lookup_),
      socket_(io),
      writable_(io),
      probe_timer_(io),
      queue_(normal_entries, state_entries, counters_.tx_dropped) {}

void UdpCarrier::open(Handler& handler) {
  close();
  if (role_ == Role::board) {
    open_board();
  } else {
    open_host();
  }
  handler_ = &handler;
  if (!socket_.is_open()) return watch();  // its address is asked for
  begin_to_receive();
  set_up(true);
  report();
  if (handler_ != nullptr && role_ == Role::host) watch();
}

void UdpCarrier::open_board() {
  const Endpoint local(lookup_.find(url_.host, url_.text), url_.port);
  standing_known_ = false;
  if (!url_.peer_host.empty()) {
    standing_ = Endpoint(lookup_.find(url_.peer_host, url_.text), url_.peer_port);
    const bool v6_socket = local.protocol() == udp::v6();
    if (v6_socket && standing_.protocol() == udp::v4()) {
      standing_.address(mapped_to_v6(standing_.address()));
    } else if (!v6_socket && standing_.protocol() == udp::v6()) {
      throw Error(ErrorKind::usage, url_.text, "an IPv4 socket cannot send to an IPv6 peer",
                  "listen on [::]");
    }
    standing_known_ = true;
  }
  bind(local);
  name_ = fmt::format("udp://{}:{}", bracketed(url_.host), socket_.local_endpoint().port());
  if (!url_.peer.empty()) name_ += "?peer=" + url_.peer;
}

// Whoever opens it in a handler of the loop has others on that loop, whom a name must not hold up.
void UdpCarrier::open_host() {
  named_ = !is_address(url_.host);
  if (named_ && io_.get_executor().running_in_this_thread()) return;
  begin(Endpoint(lookup_.find(url_.host, url_.text), url_.port));
}

// The socket of a host whose board is there.
void UdpCarrier::begin(const Endpoint& board) {
  standing_ = board;
  if (const int error = probe_route(board); error != 0) {
    throw Error(ErrorKind::open, url_.text, std::strerror(error), network_fix);
  }
  bind(Endpoint(board.protocol(), url_.listen));
  standing_known_ = true;
  const std::uint16_t local_port = socket_.local_endpoint().port();
  name_ = fmt::format("udp://{}:{}", bracketed(url_.host), url_.port);
  if (local_port != UdpUrl::host_port) name_ += fmt::format("?listen={}", local_port);
}

void UdpCarrier::watch() {
  if (named_) {
    watch_.start(url_.host, socket_.is_open(), [this](const FoundHost& answer) { found(answer); });
  } else if (host_socket_.connected()) {
    // The address of this computer may be another now.
    watch_.start([this] { host_socket_.reconnect(); });
  }
}

// Where the board of that name is, now.
void UdpCarrier::found(const FoundHost& answer) {
  const auto& addresses = answer.addresses;
  const bool is_open = socket_.is_open();
  if (is_open) {
    host_socket_.reconnect();  // or it is this computer that has moved
    const bool same =
        std::find(addresses.begin(), addresses.end(), standing_.address()) != addresses.end();
    if (same || addresses.empty()) return;
  }
  const std::string before = is_open ? standing_.address().to_string() : "";
  try {
    const Endpoint board(address_of(answer, url_.host, url_.text), url_.port);
    reception_.cancel();
    writable_.stop();
    host_socket_.close();
    begin(board);
  } catch (const Error& error) {
    watch_.set_known(socket_.is_open());
    if (!socket_.is_open()) tell_why_down(error.problem());
    return;
  }
  watch_.set_known(true);
  down_reason_.clear();
  begin_to_receive();
  if (!up_) set_up(true);
  if (is_open) {
    warn(fmt::format("the board is at {} now; it was at {}", standing_.address().to_string(),
                     before),
         "");
  }
  if (handler_ != nullptr) report();
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
    throw Error(ErrorKind::open, url_.text, "this program has that board open already",
                "use the one that is open, or ?listen=0 for another host to the board");
  }
  const std::string port = fmt::format("UDP port {}", local.port());
  if (error == asio::error::address_in_use) {
    throw Error(ErrorKind::open, url_.text, port + " is in use by another program",
                role_ == Role::host
                    ? "end that program, or use ?listen=0 to hear the board on any free port"
                    : "end that program, or listen on another port");
  }
  if (error == asio::error::access_denied) {
    throw Error(ErrorKind::permission, url_.text, port + " may not be opened: permission denied",
                "use a port from 1024 up");
  }
  throw Error(ErrorKind::open, url_.text,
              fmt::format("{} cannot be opened on {}: {}", port, local.address().to_string(),
                          error.message()),
              "use an address of this machine, or 0.0.0.0 for all of them");
}

void UdpCarrier::close() noexcept {
  handler_ = nullptr;
  up_ = reported_up_ = false;
  standing_known_ = false;
  down_reason_.clear();
  watch_.stop();
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
  if (watch_.listens()) {
    Datagram datagram;
    if (read(Text(received_.data(), size), datagram)) watch_.heard();
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
  if (audience == nullptr || !url_.peer_host.empty()) return;
  standing_ = *audience;
  standing_known_ = true;
}

SendResult UdpCarrier::send(std::string_view bytes, Priority priority, Peer to) {
  if (handler_ == nullptr) return SendResult::down;
  if (bytes.size() > max_datagram) {
    ++counters_.tx_errors;
    return SendResult::full;
  }
  if (!socket_.is_open()) return SendResult::down;
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
  const bool same_machine = !url_.peer_host.empty() && asker->address() == standing_.address();
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

void UdpCarrier::warn(const std::string& reason, const std::string& fix) {
  handler_->on_carrier_event(
      {CarrierEvent::Kind::warning, Problem{ErrorKind::open, name_, reason, fix}});
}

// It is tried again and again, and told once.
void UdpCarrier::tell_why_down(const Problem& problem) {
  if (up_) set_up(false);
  reported_up_ = false;
  if (down_reason_ == problem.reason) return;
  down_reason_ = problem.reason;
  handler_->on_carrier_event({CarrierEvent::Kind::down, problem});
}

void UdpCarrier::report_later() {
  asio::post(io_, reporting_.handler([this] { report(); }));
}

void UdpCarrier::report() {
  if (refused_error_ != reported_refusal_) {
    reported_refusal_ = refused_error_;
    if (refused_error_ != 0) {
      warn(fmt::format("the system does not send: {}", std::strerror(refused_error_)),
           refused_error_ == EPERM ? "let UDP to this address through the firewall" : "");
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
  return make_udp_carrier_with(io, url, role, HostLookup());
}

std::unique_ptr<Carrier> make_udp_carrier_with(asio::io_context& io, const Url& url, Role role,
                                               HostLookup lookup) {
  return std::make_unique<UdpCarrier>(io, url, role, std::move(lookup));
}

}  // namespace r4
