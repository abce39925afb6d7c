// SPDX-License-Identifier: GPL-3.0-or-later
// The socket with which a host hears one board. The boards of a program share the port of hosts.
// Another program cannot share this port, so a conflict is noticed. The first socket is only bound.
// A socket for a further board is bound to the same port and connected to that board. So the kernel
// gives that board's packets to the connected socket, and all other packets to the first socket. A
// packet between bind and connect may be lost.
#pragma once

#include <asio/error_code.hpp>
#include <asio/ip/udp.hpp>

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

  // Port 0: any free port. Fails with already_open if this program has that port for that board.
  asio::error_code bind(const Endpoint& local, const Endpoint& board);
  void close() noexcept;

  // True if the kernel has chosen the sending address, which may become invalid.
  bool connected() const { return connected_; }
  // If connected, lets the kernel choose again. 0, or errno.
  int reconnect();

 private:
  UdpSocket& socket_;
  Endpoint local_;
  Endpoint board_;
  bool connected_ = false;
};

}  // namespace r4
