// SPDX-License-Identifier: GPL-3.0-or-later
// Reads a socket at fixed times, the same for all sockets of a loop, and not whenever something has come: many boards
// wake a process up no more often than one does. When a packet came is asked of the kernel.
#pragma once

#include <asio/io_context.hpp>
#include <asio/ip/udp.hpp>
#include <chrono>
#include <cstddef>
#include <optional>
#include <utility>

#include "../operation_slot.hpp"
#include "udp_host_socket.hpp"

namespace r4 {

class UdpGathering {
 public:
  using SteadyTime = std::chrono::steady_clock::time_point;
  using Endpoint = asio::ip::udp::endpoint;
  static constexpr std::chrono::milliseconds interval{16};

  explicit UdpGathering(asio::io_context& io) : timer_(io) {}

  // A socket that wakes nobody up: it belongs to a loop beside `io` that does not run. It must be gone before `io`.
  static UdpSocket quiet_socket(asio::io_context& io);

  // Has the kernel note when packets come at that socket, and calls `turn()` at the next time to read it.
  template <class Turn>
  void wait(int socket, Turn turn) {
    note_times(socket);
    const SteadyTime::duration now = std::chrono::steady_clock::now().time_since_epoch();
    timer_.expires_at(SteadyTime(now - now % interval + interval));
    timer_.async_wait(turn_.handler(std::move(turn)));
  }
  void stop() {
    turn_.cancel();
    socket_ = -1;
  }

  // The size of the next packet, which may be more than there is room for; none if there is no more.
  std::optional<std::size_t> read(char* out, std::size_t room, Endpoint& from);
  // When the one that was read last came; none where that is not known.
  const std::optional<SteadyTime>& arrival() const { return arrival_; }

 private:
  void note_times(int socket);

  LoopTimer timer_;
  OperationSlot turn_;
  int socket_ = -1;
  std::optional<SteadyTime> arrival_;
};

}  // namespace r4
