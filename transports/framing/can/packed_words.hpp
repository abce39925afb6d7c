// SPDX-License-Identifier: GPL-3.0-or-later
// Tables of docs/reference/packed.md, version 1. After the first release, a change needs version 2.
#pragma once

#include <cstdint>

#include "r4link/text.hpp"

namespace r4 {

// A value that the form would write differently is sent as text, after an F.
enum class PackedForm : std::uint8_t {
  text,
  flag,        // 0-14 in 1 digit
  short3,      // 0-3839 in 3 digits
  hundredths,  // "0.00"-"38.39" in 3 digits
  drive,       // "a,b", b 0 or 1: 2a + b in 4 digits, up to EFFF
  bldc,        // "a,b,c", b and c 0 or 1: 4a + 2b + c in 4 digits, up to EFFF
  count,       // the number of digits (0-14), then the digits
  steps,       // a count of 2v if v >= 0, otherwise of -2v - 1
  bytes,       // "a,b,x3f…": two counts, the number of bytes in 2 digits, 2 digits a byte
  session,     // 16 lower-case hexadecimal digits: a 0, then the digits
};

struct PackedWord {
  char text[14] = {};  // followed by a colon, as in a field
  std::uint8_t size;   // size of the word without the colon
  PackedForm form;

  template <std::size_t N>
  // NOLINTNEXTLINE(google-explicit-constructor): the table is a list of words
  constexpr PackedWord(const char (&word)[N], PackedForm values = PackedForm::text)
      : size(N - 1), form(values) {
    static_assert(N > 1 && N < sizeof text, "a word has 1 to 12 characters");
    for (std::size_t i = 0; i + 1 < N; ++i) text[i] = word[i];
    text[N - 1] = ':';
  }
  constexpr Text word() const { return Text(text, size); }
};

namespace packed {

// Codes that the layouts name. The state fields of layout 4 come first, later fields at the end.
constexpr unsigned code_servo1pos = 0x09;
constexpr unsigned code_safe = 0x30;
constexpr unsigned code_cmd = 0x31;
constexpr unsigned state_words = 0x38;
constexpr unsigned code_r4_ros2 = 0x4B;
constexpr unsigned code_ros2_r4 = 0x4C;
constexpr unsigned word_count = 0x85;
constexpr unsigned no_word = 0xFF;

extern const PackedWord words[word_count];

// no_word if the word has no code. Constant time.
unsigned code_of(Text word);

}  // namespace packed
}  // namespace r4
