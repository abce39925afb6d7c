// SPDX-License-Identifier: GPL-3.0-or-later
// The bytes allowed in names and values (grammar: datagram.hpp), for reader and writer.
#pragma once

#include <cstddef>
#include <cstdint>

#include "r4link/text.hpp"

namespace r4 {

struct ByteClasses {
  static constexpr std::uint8_t in_name = 1;
  static constexpr std::uint8_t in_value = 2;
  static constexpr std::uint8_t in_values = 4;  // values with the commas between them

  std::uint8_t of[256] = {};
  constexpr ByteClasses() {
    for (int c = 0x20; c <= 0x7E; ++c) {
      if (c == ';' || c == '^') continue;
      of[c] = in_values;
      if (c == ',') continue;
      of[c] |= in_value;
      if (c != ' ' && c != ':') of[c] |= in_name;
    }
  }
};
extern const ByteClasses byte_classes;

inline bool is_in(std::uint8_t byte_class, char byte) {
  return (byte_classes.of[static_cast<unsigned char>(byte)] & byte_class) != 0;
}

// The first byte in [at, end) outside the class; `end`: no such byte.
inline const char* skip(std::uint8_t byte_class, const char* at, const char* end) {
  while (at != end && is_in(byte_class, *at)) ++at;
  return at;
}

// The separators in the 64 bytes of a text from `at` on, or up to its end: bit i is byte at + i.
struct Separators {
  std::uint64_t colons;
  std::uint64_t semicolons;
  std::uint64_t no_name;   // bytes not allowed in a name, except colons
  std::uint64_t no_field;  // bytes not allowed in a value, except semicolons
};
constexpr std::size_t separators_block = 64;
Separators separators(Text text, std::size_t at);

// Marks in `ends` the colon after each name and the semicolon after each field; in `short_names`
// the colons one, three or four bytes after a field's beginning. A word has a bit for each of 64
// bytes. False if the fields break the grammar. The time does not depend on their number.
bool mark_fields(Text fields, std::uint64_t* ends, std::uint64_t* short_names);

}  // namespace r4
