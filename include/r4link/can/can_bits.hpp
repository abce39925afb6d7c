// SPDX-License-Identifier: GPL-3.0-or-later
// The exact length of a frame on a CAN bus in bits (ISO 11898-1:2015, clauses 10.4 and 10.5).
//              SOF  id and control  data  CRC   delimiter  ACK  EOF  intermission
//     classic  |<------- stuffed ----------->|
//     FD       |<---- stuffed ---->|<-fixed->|
//              |<- nominal ->|<-- data rate ------->|<------- nominal ------->|
//
// After five equal bits a complementary bit is stuffed (10.5). The CRC field of an FD frame instead
// has a stuff bit at its start and after every fourth bit, and a count of the other stuff bits, so
// the length of the field is fixed. A classic CRC is stuffed, so it is computed. An FD frame
// switches its bit rate at the sample points of BRS and of the CRC delimiter. BRS counts as
// nominal, the delimiter as data. If both sample points are equal parts of a bit, the sum is exact.
// ESI counts as sent by an error-active sender. Counts include 3 bits of intermission. Linear time.
#pragma once

#include <cstdint>

#include "../config.hpp"
#include "can_frame.hpp"

namespace r4 {

constexpr std::uint32_t can_intermission_bits = 3;
constexpr std::uint32_t can_acknowledge_delimiter_bits = 1;
constexpr std::uint32_t can_end_of_frame_bits = 7;

// Bits of a frame by bit rate. A frame that does not switch its rate has only nominal bits.
struct CanBits {
  std::uint32_t nominal;
  std::uint32_t data;
};
constexpr std::uint32_t total(CanBits bits) { return bits.nominal + bits.data; }

// Bits per second. If the data rate is 0, FD frames do not switch their rate.
struct CanBitRate {
  std::uint32_t nominal;  // not 0
  std::uint32_t data;
};

// The frame's size must be valid (has_valid_size()).
R4LINK_API CanBits can_bits(const CanFrame& frame, bool switches_rate = true);

// The most bits of any frame with this format, id length and size. `size` must be valid.
R4LINK_API CanBits worst_can_bits(std::uint8_t size, bool fd, bool extended,
                                  bool switches_rate = true);

// The least bits: only the fixed stuff bits of FD frames.
R4LINK_API CanBits least_can_bits(std::uint8_t size, bool fd, bool extended,
                                  bool switches_rate = true);

// The time of the bits in nanoseconds, rounded up.
R4LINK_API std::uint64_t time_ns(CanBits bits, CanBitRate rate);
// The time for which the frame occupies the bus, including the intermission.
R4LINK_API std::uint64_t time_ns(const CanFrame& frame, CanBitRate rate);

}  // namespace r4
