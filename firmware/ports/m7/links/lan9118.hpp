// SPDX-License-Identifier: GPL-3.0-or-later
// The LAN9118 Ethernet controller: whole frames through its FIFOs. Never waits.
#pragma once

#include <cstddef>
#include <cstdint>

#include "udp_frames.hpp"

namespace r4 {
namespace m7 {

class Lan9118 {
 public:
  static constexpr std::size_t max_frame = 1536;

  // False: the chip is missing or not ready. Then no frame is received or sent.
  bool start();
  Mac mac();

  static void on_interrupt();  // acknowledges the interrupt

  bool has_received() const;
  // Reads a frame without check sequence into `frame` of max_frame bytes. 0: none, or damaged.
  std::size_t receive(std::uint32_t* frame);
  bool send(const std::uint32_t* frame, std::size_t size);  // false: no room

 private:
  bool on_ = false;
};

}  // namespace m7
}  // namespace r4
