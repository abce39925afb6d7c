// SPDX-License-Identifier: GPL-3.0-or-later
#include "udp_end.hpp"

#include <fmt/format.h>
#include <glob.h>
#include <sys/socket.h>

#include <asio/ip/v6_only.hpp>
#include <asio/post.hpp>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <sstream>
#include <utility>
#include <vector>

#include "../file_descriptor.hpp"
#include "network/packet_address.hpp"

namespace r4 {
namespace {

constexpr std::size_t normal_entries = 64;
constexpr std::size_t state_entries = 20;  // four for the host and for each watcher
constexpr std::chrono::milliseconds probe_interval{200};

bool is_network_loss(int error) {
  return error == ENETUNREACH || error == ENETDOWN || error == EHOSTUNREACH ||
         error == EADDRNOTAVAIL || error == ENODEV;
}

namespace fs = std::filesystem;

// "socket:[1234]", as /proc shows the descriptors of the sockets at that port.
std::set<fs::path> sockets_of(std::uint16_t port) {
  std::set<fs::path> sockets;
  const std::string end = fmt::format(":{:04X}", port);
  for (const char* const table : {"/proc/self/net/udp", "/proc/self/net/udp6"}) {
    std::ifstream lines(table);
    for (std::string line; std::getline(lines, line);) {
      std::istringstream text(line);
      const std::vector<std::string> words{std::istream_iterator<std::string>(text), {}};
      const bool is_meant = words.size() > 9 && words[1].ends_with(end);
      if (is_meant) sockets.insert("socket:[" + words[9] + "]");
    }
  }
  return sockets;
}

// "r4 (pid 123)"; "another program" if this user may not see it (proc(5)).
std::string user_of_udp_port(std::uint16_t port) {
  const std::set<fs::path> sockets = sockets_of(port);
  std::string user;
  glob_t files{};
  ::glob("/proc/[0-9]*/fd/*", GLOB_NOSORT, nullptr, &files);
  for (std::size_t i = 0; i < files.gl_pathc && user.empty(); ++i) {
    const fs::path file = files.gl_pathv[i];
    std::error_code gone;
    if (!sockets.contains(fs::read_symlink(file, gone))) continue;
    const fs::path process = file.parent_path().parent_path();
    std::ifstream comm(process / "comm");
    std::string name;
    if (std::getline(comm, name)) {
      user = fmt::format("{} (pid {})", name, process.filename().string());
    }
  }
  ::globfree(&files);
  return user.empty() ? "another program" : user;
}

}  // namespace

std::string bracketed(const std::string& host) {
  return host.find(':') == std::string::npos ? host : "[" + host + "]";
}

UdpEnd::UdpEnd(asio::io_context& io, UdpUrl url)
    : io_(io),
      url_(std::move(url)),
      name_(url_.text),
      socket_(io),
      writable_(io),
      probe_timer_(io),
      queue_(normal_entries, state_entries, counters_.tx_dropped) {}

void UdpEnd::open_socket(const Endpoint& local, bool v6_only) {
  asio::error_code error;
  open_close_on_exec(socket_, local.protocol(), error);
  if (!error && local.protocol() == asio::ip::udp::v6()) {
    socket_.set_option(asio::ip::v6_only(v6_only), error);
  }
  if (!error) socket_.native_non_blocking(true, error);
  if (error) refuse(error, local, "");
}

void UdpEnd::refuse(const asio::error_code& error, const Endpoint& local, const std::string& fix) {
  close_socket();
  if (const auto problem = out_of_resources(url_.text, error.value())) throw Error(*problem);
  const std::string port = fmt::format("UDP port {}", local.port());
  if (error == asio::error::address_in_use) {
    throw Error(ErrorKind::open, url_.text,
                fmt::format("{} is in use by {}", port, user_of_udp_port(local.port())), fix);
  }
  if (error == asio::error::access_denied) {
    throw Error(ErrorKind::permission, url_.text, port + " cannot be opened: permission denied",
                "use a port from 1024 up");
  }
  throw Error(ErrorKind::open, url_.text,
              fmt::format("{} cannot be opened on {}: {}", port, local.address().to_string(),
                          error.message()),
              "use an address of this computer, or 0.0.0.0 for all its addresses");
}

void UdpEnd::close_socket() noexcept {
  asio::error_code ignored;
  socket_.close(ignored);
}

void UdpEnd::begin(Handler& handler) {
  handler_ = &handler;
  listen();
  set_up(true);
  report();
}

void UdpEnd::close() noexcept {
  handler_ = nullptr;
  up_ = cut_ = false;
  why_down_ = {};
  reported_.clear();
  refused_error_ = reported_refusal_ = 0;
  reporting_.cancel();
  reception_.cancel();
  probe_.cancel();
  writable_.stop();
  queue_.clear();
  close_socket();
}

void UdpEnd::hand_over(std::string_view bytes, Peer from) {
  ++counters_.rx_datagrams;
  counters_.rx_bytes += bytes.size();
  handler_->on_datagram(bytes, from);
}

SendResult UdpEnd::send(std::string_view bytes, Priority priority, Peer to) {
  if (!socket_.is_open()) return SendResult::down;
  if (bytes.size() > max_datagram) {
    ++counters_.tx_errors;
    return SendResult::full;
  }
  if (queue_.empty()) {
    const SendResult outcome = transmit(bytes, to);
    if (outcome != SendResult::full) return outcome;
  }
  const SendResult result = queue_.push(bytes, priority, to, std::chrono::steady_clock::now());
  writable_.start(socket_.native_handle(), [this] { send_waiting(); });
  return result;
}

void UdpEnd::send_waiting() {
  while (const SendQueue::Entry* entry = queue_.front(std::chrono::steady_clock::now())) {
    if (transmit(entry->text(), entry->to) == SendResult::full) {
      writable_.start(socket_.native_handle(), [this] { send_waiting(); });
      return;
    }
    queue_.pop();
  }
  writable_.stop();
}

SendResult UdpEnd::transmit_to(std::string_view bytes, const Endpoint& to, bool standing,
                               const asio::ip::address& from) {
  int error = send_packet(socket_.native_handle(), bytes, to, from);
  // ECONNREFUSED is about an earlier packet: no program listened there. This packet was not sent.
  if (error == ECONNREFUSED) error = send_packet(socket_.native_handle(), bytes, to, from);
  if (error == 0 || error == ECONNREFUSED) {
    ++counters_.tx_datagrams;
    counters_.tx_bytes += bytes.size();
    refused_error_ = 0;
    if (!up_ && !cut_) {
      set_up(true);
      report_later();
    }
    return SendResult::sent;
  }
  if (error == EAGAIN || error == EWOULDBLOCK) return SendResult::full;
  // The interface's queue is full, and the system does not report when it has room.
  if (error == ENOBUFS) {
    ++counters_.tx_dropped;
    return SendResult::sent;
  }
  ++counters_.tx_errors;
  if (!is_network_loss(error)) {
    refused_error_ = error;
    report_later();
  } else if (standing && up_) {
    lose_network(error);
  }
  return SendResult::down;
}

void UdpEnd::set_up(bool up) {
  if (up == up_) return;
  up_ = up;
  cut_ = cut_ && !up;
  ++(up ? counters_.ups : counters_.downs);
  probe_.cancel();
}

void UdpEnd::lose_network(int error) {
  why_down_ = no_route(name_, error);
  set_up(false);
  probe_later();
  report_later();
}

void UdpEnd::check_network(const std::vector<OwnAddress>& own) {
  if (!socket_.is_open()) return;
  const int error = probe(own);
  if (error != 0 && !is_network_loss(error)) return;
  cut_ = error != 0;
  if (cut_ && up_) lose_network(error);
  if (cut_ || up_) return;
  set_up(true);
  report_later();
}

void UdpEnd::warn(const std::string& reason, const std::string& fix) {
  handler_->on_carrier_event(
      {CarrierEvent::Kind::warning, Problem{ErrorKind::open, name_, reason, fix}});
}

void UdpEnd::report_later() {
  asio::post(io_, reporting_.handler([this] { report(); }));
}

void UdpEnd::report() {
  if (refused_error_ != reported_refusal_) {
    reported_refusal_ = refused_error_;
    if (refused_error_ != 0) {
      warn(fmt::format("the system refuses to send: {}", std::strerror(refused_error_)),
           refused_error_ == EPERM ? "allow UDP to this address in the firewall" : "");
    }
  }
  const std::string status = up_ ? "up" : why_down_.reason;
  if (handler_ == nullptr || status == reported_) return;
  reported_ = status;
  handler_->on_carrier_event(
      up_ ? CarrierEvent{CarrierEvent::Kind::up, Problem{ErrorKind::open, name_, "", ""}}
          : CarrierEvent{CarrierEvent::Kind::down, why_down_});
}

Problem UdpEnd::no_route(const std::string& subject, int error) const {
  if (error == EADDRNOTAVAIL && !url_.local.is_unspecified()) {
    return {ErrorKind::open, subject,
            fmt::format("this computer does not have the address {} at the moment",
                        url_.local.to_string()),
            "connect its interface, or name an address that `ip address` shows"};
  }
  if (auto problem = out_of_resources(subject, error)) return std::move(*problem);
  return {ErrorKind::open, subject, std::strerror(error),
          "check the WiFi or cable and the address"};
}

// The interface may work again while nothing is sent.
void UdpEnd::probe_later() {
  probe_timer_.expires_after(probe_interval);
  probe_timer_.async_wait(probe_.handler([this] {
    check_network(own_addresses());
    if (!up_) probe_later();
  }));
}

}  // namespace r4
