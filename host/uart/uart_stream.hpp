// SPDX-License-Identifier: GPL-3.0-or-later
// Joins the received bytes of a UART from states. A state may be missing, late or a duplicate
// (firmware/devices/user_uart.hpp).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "r4link/board.hpp"

namespace r4 {

class UartStream {
 public:
  static constexpr std::size_t capacity = std::size_t{64} * 1024;

  // Call restart() when the board has restarted, because the board then counts from 0.
  void restart() { begun_ = false; }

  // Appends new bytes and losses to each of `outs`. True if it appended any.
  template <class... Outs>
  bool take(const UartBytes& field, Outs&... outs) {
    if (!begun_) {
      begun_ = true;
      next_ = field.position;
      lost_ = field.lost;
    }
    const auto known = static_cast<std::int32_t>(next_ - field.position);
    const auto damaged = static_cast<std::int32_t>(field.lost - lost_);
    if (known > field.data.size || damaged < 0) return false;  // from an older state
    const std::uint64_t lost = static_cast<std::uint64_t>(damaged) +
                               (known < 0 ? 0U - static_cast<std::uint32_t>(known) : 0U);
    next_ = field.position + field.data.size;
    lost_ = field.lost;
    const std::uint8_t* const fresh = field.data.begin() + std::max(known, 0);
    (append(outs, fresh, field.data.end(), lost), ...);
    return fresh != field.data.end() || lost != 0;
  }

 private:
  // Above the capacity, the oldest bytes are lost.
  static void append(Board::UartData& out, const std::uint8_t* begin, const std::uint8_t* end,
                     std::uint64_t lost) {
    out.bytes.insert(out.bytes.end(), begin, end);
    out.lost += lost;
    if (out.bytes.size() <= capacity) return;
    const std::size_t excess = out.bytes.size() - capacity;
    out.bytes.erase(out.bytes.begin(), out.bytes.begin() + static_cast<std::ptrdiff_t>(excess));
    out.lost += excess;
  }

  bool begun_ = false;
  std::uint32_t next_ = 0;  // the position of the next byte
  std::uint32_t lost_ = 0;  // the board's count of lost bytes
};

}  // namespace r4
