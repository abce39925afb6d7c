// SPDX-License-Identifier: GPL-3.0-or-later
// The socket at which a host hears one board. The boards of a program share the port of hosts.
//
// The first socket at a port has it alone, so that another program at that port is noticed. It is
// not connected, so it hears its board from any of the board's ports. A further socket is bound
// beside it and connected to its board, so the kernel gives it the packets from the board's port
// only. A packet that comes in the microseconds between bind and connect may be lost.
#pragma once

#include <asio/error_code.hpp>
#include <asio/io_context.hpp>
#include <asio/ip/udp.hpp>
#include <atomic>
#include <cstdint>

#include "../operation_slot.hpp"

namespace r4 {

using UdpSocket = asio::basic_datagram_socket<asio::ip::udp, LoopExecutor>;

class UdpHostSocket {
 public:
  using Endpoint = asio::ip::udp::endpoint;

  explicit UdpHostSocket(UdpSocket& socket) : socket_(socket) {}
  UdpHostSocket(const UdpHostSocket&) = delete;
  UdpHostSocket& operator=(const UdpHostSocket&) = delete;
  ~UdpHostSocket() { close(); }

  // Binds the open socket to `local` (port 0: any free port), to hear `board`. Fails with
  // asio::error::already_open if this program hears that board there already.
  asio::error_code bind(const Endpoint& local, const Endpoint& board);
  // Closes the socket. Can be called twice.
  void close() noexcept;

  // True if the kernel has chosen the address from which it sends. That address may go.
  bool connected() const { return connected_; }
  // Lets the kernel choose again, if it is connected. 0, or errno.
  int reconnect();

  // True if `sender` is the board.
  bool hears(const Endpoint& sender) const {
    return sender.address() == board_.address() &&
           (!neighbours_.load(std::memory_order_relaxed) || sender.port() == board_.port());
  }

 private:
  UdpSocket& socket_;
  int descriptor_ = -1;  // -1: it is not bound
  Endpoint local_;
  Endpoint board_;
  bool connected_ = false;
  // Another board of this program is, or was, at the same address: the port tells them apart.
  std::atomic<bool> neighbours_{false};
};

}  // namespace r4
