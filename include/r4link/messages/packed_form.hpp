// SPDX-License-Identifier: GPL-3.0-or-later
// The packed form: a datagram recoded for a CAN bus (docs/packed.md). A state of the paper's 154
// bytes becomes 25, a heartbeat 13.
//
//     packed = head numbers digits checksum
//     head     1 byte: 10 LLL SSS: version 1, the layout, how many digits PNum and T have
//     numbers  PNum and T in hexadecimal digits of 4 bits, as the layout says
//     digits   fields, 4 bits at a time: names and words by code (packed_words.hpp), values in the
//              form of their name; an F fills the last byte
//     checksum 4 bytes, the number behind "^0x"
//
// Stateless and lossless: unpack() gives back the very bytes that pack() took. Any datagram of the
// grammar may be given; what does not pack, or would not get shorter, travels plain. A plain
// datagram begins with a character below 0x80, so every reader can take both.
//
// Damage. The checksum is the datagram's own, over its plain bytes, and neither function looks at it:
// the reader above does. A damaged packed form either is refused here, or unpacks to the same bytes
// (a number with more digits than it needs: harmless), or to other bytes, which then claim a
// checksum that is right once in 2^32. That is what CRC-32 gives for any error; its certainty about
// errors of a few bits does not come through, because one bit here may be several bytes there.
// Several bits, too, are no rule: a frame's own CRC-15 is what guards the bits on the bus, and what
// passes it is a lost or foreign frame. What unpacks is always of the grammar.
//
// No heap; about 600 bytes of stack; linear in the size.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../datagram.hpp"

namespace r4 {

constexpr std::uint8_t packed_version = 1;

// May these bytes be a packed datagram? Tells it from a plain one by its first byte.
constexpr bool is_packed(std::uint8_t first_byte) { return first_byte >= 0x80; }

// Packs one datagram (without line terminator). Returns the size at `out`, always smaller than the
// datagram's; 0, with `out` undefined, if it must travel plain: not of the grammar, a checksum not in
// the form that writers print, a name too long, no gain, or more than `capacity` bytes.
R4LINK_API std::size_t pack(Text datagram, std::uint8_t* out, std::size_t capacity);

enum class UnpackError : std::uint8_t {
  none,
  length,   // too short to be one, or longer than max_datagram or `capacity` when unpacked
  version,  // a first byte that version 1 does not have: of a plain datagram, or of a later version
  syntax,   // not of the form: an unknown code, a byte that the grammar forbids, an end too early
};

// "length", "version", "syntax"; "" for none.
R4LINK_API const char* to_text(UnpackError error);

struct UnpackResult {
  UnpackError error = UnpackError::none;
  std::size_t size = 0;  // of the datagram at `out`; 0 on error
  explicit operator bool() const { return error == UnpackError::none; }
};

// Unpacks into `out`. Any bytes are safe; never more than `capacity` bytes are written, and what is
// there after an error has no meaning. The checksum is copied, not checked: read_datagram() does.
R4LINK_API UnpackResult unpack(const std::uint8_t* bytes, std::size_t size, char* out,
                               std::size_t capacity);

}  // namespace r4
