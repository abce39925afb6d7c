// SPDX-License-Identifier: GPL-3.0-or-later
// One frame on a CAN bus, classic or FD (ISO 11898-1).
#pragma once

#include <cstdint>

namespace r4 {

constexpr std::uint8_t max_classic_size = 8;  // bytes of data in a classic frame
constexpr std::uint8_t max_fd_size = 64;      // bytes of data in an FD frame
constexpr std::uint32_t max_can_id = 0x7FF;   // 11 bits; the lower id wins the bus

// A CanFrame has no initialisers, so it costs no time. `CanFrame frame{}` is all zero.
struct CanFrame {
  std::uint32_t id;   // 11 bits, or 29 if `extended`
  std::uint8_t size;  // bytes of data: 0–8, in an FD frame also 12, 16, 20, 24, 32, 48, 64
  bool fd;            // FD format
  bool extended;      // 29-bit id
  bool remote;        // remote transmission request, without data
  std::uint8_t data[max_fd_size];
};

// The smallest valid data size that holds `size` bytes. For more than 64 bytes: 64.
constexpr std::uint8_t can_frame_size(std::uint32_t size) {
  return size <= 8    ? static_cast<std::uint8_t>(size)
         : size <= 12 ? 12
         : size <= 16 ? 16
         : size <= 20 ? 20
         : size <= 24 ? 24
         : size <= 32 ? 32
         : size <= 48 ? 48
                      : 64;
}

constexpr bool has_valid_size(const CanFrame& frame) {
  return frame.size <= max_classic_size || (frame.fd && can_frame_size(frame.size) == frame.size);
}

}  // namespace r4
