// SPDX-License-Identifier: GPL-3.0-or-later
// A transport of your own: datagrams over one end of a socketpair() of type SOCK_SEQPACKET. A
// radio's driver has the other end.
#pragma once

#include <sys/socket.h>

#include <atomic>
#include <r4link/carrier.hpp>
#include <r4link/datagram.hpp>
#include <thread>

class SocketCarrier final : public r4::Carrier {
 public:
  SocketCarrier(r4::Loop& loop, int socket) : loop_(loop), socket_(socket) {}
  ~SocketCarrier() override { close(); }

  void open(Handler& handler) override {
    handler_ = &handler;
    opening_ = std::make_shared<int>();
    reader_ = std::thread([this, opening = std::weak_ptr<int>(opening_)] { read(opening); });
    set_up(true, "");
  }
  void close() noexcept override {
    handler_ = nullptr;
    opening_.reset();
    up_ = false;
    if (!reader_.joinable()) return;
    ::shutdown(socket_, SHUT_RDWR);  // ends the reader's wait; the socket is not usable afterwards
    reader_.join();
  }
  r4::SendResult send(std::string_view bytes, r4::Priority, r4::Peer) override {
    if (!up_) return r4::SendResult::down;
    const ssize_t sent = ::send(socket_, bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
    ++(sent >= 0 ? counters_.tx_datagrams : counters_.tx_errors);
    return sent >= 0 ? r4::SendResult::sent : r4::SendResult::full;
  }
  bool up() const override { return up_; }
  const std::string& name() const override { return name_; }
  const r4::CarrierCounters& counters() const override { return counters_; }

 private:
  // Runs on a separate thread, which may wait. Posts each datagram to the loop. After close(),
  // the loop drops these datagrams.
  void read(const std::weak_ptr<int>& opening) {
    char bytes[r4::max_datagram];
    for (ssize_t size = 1; size > 0;) {
      size = ::recv(socket_, bytes, sizeof bytes, 0);
      ++waiting_;
      loop_.post([this, opening, datagram = std::string(bytes, size > 0 ? size : 0)] {
        if (!opening.expired()) take(datagram);
      });
    }
  }
  void take(const std::string& datagram) {
    if (datagram.empty()) return set_up(false, "the other end was closed");
    ++counters_.rx_datagrams;
    handler_->on_datagram(datagram, r4::everyone);
    if (--waiting_ == 0 && handler_ != nullptr) handler_->on_drained();
  }
  void set_up(bool up, const char* reason) {
    up_ = up;
    const auto kind = up ? r4::CarrierEvent::Kind::up : r4::CarrierEvent::Kind::down;
    handler_->on_carrier_event({kind, {r4::ErrorKind::open, name_, reason, ""}});
  }

  r4::Loop& loop_;
  const int socket_;
  const std::string name_ = "radio";
  Handler* handler_ = nullptr;
  std::shared_ptr<int> opening_;  // null: closed
  bool up_ = false;
  r4::CarrierCounters counters_;
  std::atomic<int> waiting_{0};  // datagrams posted to the loop
  std::thread reader_;
};
