// SPDX-License-Identifier: GPL-3.0-or-later
// How long a frame is on a CAN bus, to the bit (ISO 11898-1:2015, clauses 10.4 and 10.5).
//
//              SOF  id and control  data  CRC   delimiter  ACK  EOF  intermission
//     classic  |<------- stuffed ----------->|
//     FD       |<---- stuffed ---->|<-fixed->|
//              |<- nominal ->|<-- data rate ------->|<------- nominal ------->|
//
// After five equal bits a complementary one is stuffed in (10.5). In an FD frame the CRC field has
// a stuff bit at its beginning and after every fourth bit instead, and a count of the others: its
// length does not depend on its value. A classic CRC takes part in stuffing and is computed.
//
// An FD frame that switches its bit rate does so at the sample points of BRS and of the CRC
// delimiter. BRS is counted as nominal here and the delimiter as data: exact in the sum where both
// sample points are the same part of their bits. ESI is that of an error-active sender.
//
// Every count includes the 3 bits of intermission, after which the next frame may begin.
// No allocation, no state. Time is linear in the size of the frame.
#pragma once

#include <cstdint>

#include "../config.hpp"
#include "can_frame.hpp"

namespace r4 {

constexpr std::uint32_t can_intermission_bits = 3;
constexpr std::uint32_t can_acknowledge_delimiter_bits = 1;
constexpr std::uint32_t can_end_of_frame_bits = 7;

// Bits of a frame by the rate at which they travel. All of a frame that does not switch is nominal.
struct CanBits {
  std::uint32_t nominal;
  std::uint32_t data;
};
constexpr std::uint32_t total(CanBits bits) { return bits.nominal + bits.data; }

// Bits per second. FD frames switch to the data rate; with 0 they do not switch.
struct CanBitRate {
  std::uint32_t nominal;  // not 0
  std::uint32_t data;
};

// The bits of that very frame. Its size must be one that it can have (has_valid_size()).
R4LINK_API CanBits can_bits(const CanFrame& frame, bool switches_rate = true);

// No frame of that format, id length and size has more. `size` must be one that a frame can have.
R4LINK_API CanBits worst_can_bits(std::uint8_t size, bool fd, bool extended,
                                  bool switches_rate = true);

// The same without any stuff bit, but for those of an FD frame that are always there.
R4LINK_API CanBits least_can_bits(std::uint8_t size, bool fd, bool extended,
                                  bool switches_rate = true);

// How long the bits take, in nanoseconds, rounded up.
R4LINK_API std::uint64_t time_ns(CanBits bits, CanBitRate rate);
// How long the frame holds the bus, its intermission included.
R4LINK_API std::uint64_t time_ns(const CanFrame& frame, CanBitRate rate);

}  // namespace r4
