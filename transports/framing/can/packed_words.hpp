// SPDX-License-Identifier: GPL-3.0-or-later
// The words that the packed form has a number for, and in which form it writes each field's values.
// docs/packed.md has the same tables; they are of version 1 and change only with the version.
#pragma once

#include <cstdint>

#include "r4link/text.hpp"

namespace r4 {

// How the values of a field lie in the packed form. A text that is not exactly what the form would
// be written as travels as text, behind an F.
enum class PackedForm : std::uint8_t {
  text,
  flag,        // 0-14 in 1 digit
  short3,      // 0-3839 in 3
  hundredths,  // "0.00"-"38.39" in 3
  drive,       // "a,b", b 0 or 1: 2a + b in 4, up to EFFF
  bldc,        // "a,b,c", b and c 0 or 1: 4a + 2b + c in 4, up to EFFF
  count,       // how many digits (0-14), then those
  steps,       // a count of 2v for v >= 0, of -2v - 1 below
  bytes,       // "a,b,x3f…": two counts, how many bytes in 2, those in 2 each
  session,     // 16 lower-case hexadecimal digits: a 0, then those
};

struct PackedWord {
  char text[14] = {};  // with a colon behind it, as a field has
  std::uint8_t size;   // of the word alone
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

// Codes that the layouts name; the first are state fields, in the order of the wire.
constexpr unsigned code_servo1pos = 0x09;
constexpr unsigned code_safe = 0x30;
constexpr unsigned code_cmd = 0x31;
constexpr unsigned state_words = 0x38;
constexpr unsigned code_r4_ros2 = 0x4B;
constexpr unsigned code_ros2_r4 = 0x4C;
constexpr unsigned word_count = 0x85;
constexpr unsigned no_word = 0xFF;

extern const PackedWord words[word_count];

// The code of a word; no_word if it has none. Constant time.
unsigned code_of(Text word);

}  // namespace packed
}  // namespace r4
