// SPDX-License-Identifier: GPL-3.0-or-later
// A CAN_ISOTP socket: the ISO-TP of the Linux kernel, an implementation independent of our engine.
#pragma once

#include <linux/can/isotp.h>

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "tests/transports/can/kernel/raw_can.hpp"

namespace r4::test {

struct KernelIsotpOptions {
  std::uint32_t flags = 0;  // CAN_ISOTP_*
  std::uint8_t tx_dl = 8;   // more than 8: only FD frames are sent and received
  std::uint8_t tx_padding = 0xAA;
  std::uint8_t rx_padding = 0xCC;
  std::uint8_t block_size = 0;
  std::uint8_t stmin = 0;
  // Without this value, each frame waits for a timer.
  std::uint32_t frame_txtime_ns = CAN_ISOTP_FRAME_TXTIME_ZERO;
};

class KernelIsotp : CanSocket {
 public:
  KernelIsotp(std::uint32_t heard_id, std::uint32_t sent_id, const KernelIsotpOptions& chosen)
      : CanSocket(SOCK_DGRAM, CAN_ISOTP) {
    can_isotp_options options{};
    options.flags = chosen.flags;
    options.frame_txtime = chosen.frame_txtime_ns;
    options.txpad_content = chosen.tx_padding;
    options.rxpad_content = chosen.rx_padding;
    set(SOL_CAN_ISOTP, CAN_ISOTP_OPTS, options, "CAN_ISOTP_OPTS");
    set(SOL_CAN_ISOTP, CAN_ISOTP_RECV_FC, can_isotp_fc_options{chosen.block_size, chosen.stmin, 0},
        "CAN_ISOTP_RECV_FC");
    const bool fd = chosen.tx_dl > max_classic_size;
    set(SOL_CAN_ISOTP, CAN_ISOTP_LL_OPTS,
        can_isotp_ll_options{static_cast<std::uint8_t>(fd ? CANFD_MTU : CAN_MTU), chosen.tx_dl, 0},
        "CAN_ISOTP_LL_OPTS");
    sockaddr_can address{};
    address.can_addr.tp.rx_id = heard_id;
    address.can_addr.tp.tx_id = sent_id;
    bind_to_interface(address);
  }

  // Waits until the last transfer has ended. Returns when the first frame is on the bus.
  void send(const std::string& datagram) {
    const ssize_t size = write(fd(), datagram.data(), datagram.size());
    if (size != static_cast<ssize_t>(datagram.size())) fail("CAN_ISOTP send");
  }

  // The next datagram. None if it does not arrive within the limit, or after an error.
  std::optional<std::string> receive(std::uint32_t limit_us = 2000000) {
    std::string datagram(65536, '\0');
    const std::uint32_t until_us = clock_us() + limit_us;
    ssize_t size;
    while ((size = recv(fd(), datagram.data(), datagram.size(), MSG_DONTWAIT)) < 0) {
      if (errno != EAGAIN) {
        error_ = errno;
        return std::nullopt;
      }
      if (!await(fd(), POLLIN, until_us) && reached(clock_us(), until_us)) return std::nullopt;
    }
    datagram.resize(static_cast<std::size_t>(size));
    return datagram;
  }

  // Waits for the next datagram without a limit. Returns its size, at most `size`.
  std::size_t await_datagram(void* data, std::size_t size) {
    const ssize_t got = recv(fd(), data, size, 0);
    if (got < 0) fail("CAN_ISOTP receive");
    return static_cast<std::size_t>(got);
  }

  // The errno since the last call. 0: no error. Waits for an error up to `limit_us`.
  int error(std::uint32_t limit_us = 0) {
    int error = std::exchange(error_, 0);
    if (error == 0 && limit_us != 0) await(fd(), 0, clock_us() + limit_us);
    socklen_t size = sizeof error;
    if (error == 0 && getsockopt(fd(), SOL_SOCKET, SO_ERROR, &error, &size) != 0) fail("SO_ERROR");
    return error;
  }

 private:
  int error_ = 0;
};

}  // namespace r4::test
