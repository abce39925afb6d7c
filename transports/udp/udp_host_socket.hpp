// SPDX-License-Identifier: GPL-3.0-or-later
// The socket at which a host hears one board, and what the boards of a program have to do with each
// other there: they share the port of hosts.
//
// The first at a port has it alone, so that another program at that port is noticed, and is not
// connected: it hears its board from any of the board's ports. A further one is bound beside it and
// connected to its board, so the kernel hands it what comes from there, and from that port only.
// What is under way in the microseconds between the two may be lost.
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

  // Binds the socket, which is open, to `local` (port 0: any free one), to hear `board`. Fails with
  // asio::error::already_open if this program hears that board there already.
  asio::error_code bind(const Endpoint& local, const Endpoint& board);
  // Closes the socket. Can be called twice.
  void close() noexcept;

  // Connected: the kernel has chosen the address that it sends from, which may be gone.
  bool connected() const { return connected_; }
  // Has it chosen again, if it has. 0, or errno.
  int reconnect();

  // Does the board send from there?
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
  // Another board of this program is, or was, at this one's address: they differ by their port.
  std::atomic<bool> neighbours_{false};
};

}  // namespace r4
