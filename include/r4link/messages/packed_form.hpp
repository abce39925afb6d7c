// SPDX-License-Identifier: GPL-3.0-or-later
// The packed form of a datagram, for a CAN bus (docs/reference/packed.md). A state of the paper,
// 154 bytes, becomes 25 bytes, a heartbeat 13 bytes.
//     packed = head numbers digits checksum
//     head     1 byte: 10 LLL SSS: version 1, the layout, number of digits of PNum and T
//     numbers  PNum and T in hexadecimal digits of 4 bits, by the layout
//     digits   fields, 4 bits at a time: names and words by code (packed_words.hpp), values in the
//              form of their name; an F fills the last byte
//     checksum 4 bytes, the number after "^0x"
//
// Stateless and lossless: unpack() returns exactly the bytes that pack() was given. A datagram that
// cannot be packed or would not become shorter is sent plain. A plain datagram starts with a byte
// below 0x80, so every reader accepts both forms. No heap; about 600 bytes of stack; linear in the
// size. Neither function checks the checksum, because read_datagram() does. A damaged packed form
// is refused, or unpacks to the same bytes (superfluous digits) or to other valid bytes. The
// checksum of other bytes is right once in 2^32. CRC-32's guarantee for a few wrong bits is lost,
// because one wrong bit may become several bytes. The frame's CRC-15 protects the bits on the bus.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../datagram.hpp"

namespace r4 {

constexpr std::uint8_t packed_version = 1;

// True if the bytes may be a packed datagram. A plain datagram has a smaller first byte.
constexpr bool is_packed(std::uint8_t first_byte) { return first_byte >= 0x80; }

// Packs one datagram (without a line terminator). Returns the size at `out`, which is smaller than
// the size of the datagram. If the datagram must be sent plain, returns 0, and `out` is undefined:
//     the datagram is not valid, or its checksum has another form than writers print
//     a name is too long
//     the packed form is not shorter, or exceeds `capacity` bytes
R4LINK_API std::size_t pack(Text datagram, std::uint8_t* out, std::size_t capacity);

enum class UnpackError : std::uint8_t {
  none,
  length,   // too short, or longer than max_datagram or `capacity` when unpacked
  version,  // the first byte is not of version 1: a plain datagram or a later version
  syntax,   // an unknown code, a forbidden byte, or an early end
};

// "length", "version", "syntax"; "" for none.
R4LINK_API const char* to_text(UnpackError error);

struct UnpackResult {
  UnpackError error = UnpackError::none;
  std::size_t size = 0;  // size of the datagram at `out`; 0 on error
  explicit operator bool() const { return error == UnpackError::none; }
};

// Safe for any bytes. After an error, `out` is undefined.
R4LINK_API UnpackResult unpack(const std::uint8_t* bytes, std::size_t size, char* out,
                               std::size_t capacity);

}  // namespace r4
