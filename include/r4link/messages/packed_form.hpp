// SPDX-License-Identifier: GPL-3.0-or-later
// The packed form: a datagram recoded for a CAN bus (docs/reference/packed.md). A state of the
// paper, 154 bytes, becomes 25 bytes, a heartbeat 13.
//
//     packed = head numbers digits checksum
//     head     1 byte: 10 LLL SSS: version 1, the layout, number of digits of PNum and T
//     numbers  PNum and T in hexadecimal digits of 4 bits, by the layout
//     digits   fields, 4 bits at a time: names and words by code (packed_words.hpp), values in the
//              form of their name; an F fills the last byte
//     checksum 4 bytes, the number after "^0x"
//
// Stateless and lossless: unpack() returns exactly the bytes that pack() took. A datagram that does
// not pack, or would not become shorter, travels plain. A plain datagram starts with a byte below
// 0x80, so every reader accepts both. No heap; about 600 bytes of stack; linear in the size.
// Damage: neither function checks the checksum; the reader above does. A damaged packed form is
// refused, or unpacks to the same bytes (a number with superfluous digits: harmless), or to other
// bytes of the grammar, whose checksum is right once in 2^32. CRC-32's guarantee for a few wrong
// bits is lost, as one bit may become several bytes; the frame's CRC-15 guards bits on the bus.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../datagram.hpp"

namespace r4 {

constexpr std::uint8_t packed_version = 1;

// True if the bytes may be a packed datagram: the first byte of a plain one is smaller.
constexpr bool is_packed(std::uint8_t first_byte) { return first_byte >= 0x80; }

// Packs one datagram (without line terminator). Returns the size at `out`, always smaller than the
// datagram's. 0, with `out` undefined, if it must travel plain: not of the grammar, a checksum in
// another form than writers print, a name too long, no gain, or more than `capacity` bytes.
R4LINK_API std::size_t pack(Text datagram, std::uint8_t* out, std::size_t capacity);

enum class UnpackError : std::uint8_t {
  none,
  length,   // too short, or unpacked longer than max_datagram or `capacity`
  version,  // not a first byte of version 1: a plain datagram, or a later version
  syntax,   // an unknown code, a byte that the grammar forbids, or an early end
};

// "length", "version", "syntax"; "" for none.
R4LINK_API const char* to_text(UnpackError error);

struct UnpackResult {
  UnpackError error = UnpackError::none;
  std::size_t size = 0;  // of the datagram at `out`; 0 on error
  explicit operator bool() const { return error == UnpackError::none; }
};

// Safe for any bytes. After an error `out` is undefined. read_datagram() checks the checksum.
R4LINK_API UnpackResult unpack(const std::uint8_t* bytes, std::size_t size, char* out,
                               std::size_t capacity);

}  // namespace r4
