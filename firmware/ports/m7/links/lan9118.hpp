// SPDX-License-Identifier: GPL-3.0-or-later
// The LAN9118 Ethernet controller: whole frames through its FIFOs, nothing waited for.
#pragma once

#include <cstddef>
#include <cstdint>

#include "udp_frames.hpp"

namespace r4 {
namespace m7 {

class Lan9118 {
 public:
  static constexpr std::size_t max_frame = 1536;

  // False: there is no such chip, or it is not ready. Then nothing comes and nothing goes.
  bool start();
  Mac mac();

  // In its interrupt: it is heard.
  static void on_interrupt();

  bool has_received() const;
  // The next frame without its check sequence, up to max_frame bytes, into `frame`, which is of whole
  // words. 0: none, or it was damaged.
  std::size_t receive(std::uint32_t* frame);
  // False: there is no room for it now.
  bool send(const std::uint32_t* frame, std::size_t size);

 private:
  bool on_ = false;
};

}  // namespace m7
}  // namespace r4
