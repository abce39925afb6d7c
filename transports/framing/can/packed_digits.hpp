// SPDX-License-Identifier: GPL-3.0-or-later
// Writes the digits of a packed datagram, 4 bits each, the upper half of a byte first.
#pragma once

#include <cstddef>
#include <cstdint>

namespace r4 {
namespace packed {

class DigitWriter {
 public:
  DigitWriter(std::uint8_t* out, std::uint8_t* end) : at_(out), end_(end) {}

  // Writes the last `digits` hexadecimal digits of `value`; at most 14.
  bool put(std::uint64_t value, unsigned digits) {
    // Local variables, because the written bytes may alias any member.
    const std::uint64_t pending = pending_ << 4 * digits | value;
    unsigned count = count_ + digits;
    std::uint8_t* at = at_;
    if (end_ - at < static_cast<std::ptrdiff_t>((count + 1) / 2)) {
      end_ = at;  // so that later digits do not fit either
      count_ = 1;
      return false;
    }
    while (count >= 2) {
      count -= 2;
      *at++ = static_cast<std::uint8_t>(pending >> 4 * count);
    }
    at_ = at;
    pending_ = pending;
    count_ = count;
    return true;
  }
  bool put_bytes(const char* begin, const char* end) {
    for (; begin != end; ++begin) {
      if (!put(static_cast<unsigned char>(*begin), 2)) return false;
    }
    return true;
  }
  // Fills the last byte; returns the end of the digits.
  std::uint8_t* finish() {
    if (count_ != 0) put(0xF, 1);
    return at_;
  }

 private:
  std::uint8_t* at_;
  std::uint8_t* end_;
  std::uint64_t pending_ = 0;  // the last `count_` digits are not yet written
  unsigned count_ = 0;
};

}  // namespace packed
}  // namespace r4
