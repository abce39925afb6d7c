// SPDX-License-Identifier: GPL-3.0-or-later
// Numbers from text and to text, for all code. The whole text must be the number, without blanks
// and '+'. For other text a reader returns false and leaves `out` unchanged, except where noted.
#pragma once

#include <cstddef>
#include <cstdint>

#include "r4link/text.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {

bool parse_number(Text text, std::uint32_t& out);
bool parse_number(Text text, std::uint64_t& out);
bool parse_number(Text text, std::int32_t& out);

// True for any number of digits after an optional '-': distinguishes out of range from wrong form.
bool is_whole_number(Text text);

// A decimal such as "24.28", "-0.5" or "12" in hundredths of its unit (2428, -50, 1200). Further
// decimals are cut off. |value| must be less than 20 million units. At most 40 characters.
bool parse_hundredths(Text text, std::int32_t& out);

// 1 to 8 hexadecimal digits, either case, leading zeros allowed.
bool parse_hex(Text text, std::uint32_t& out);
// Exactly `size` bytes, two digits each. Writes to `out` even when it returns false.
bool parse_hex(Text text, std::uint8_t* out, std::size_t size);

// 16 lower-case hexadecimal digits, not all 0. Writes to `out` even when it returns false.
constexpr std::size_t session_id_size = 16;
bool parse_session_id(Text text, SessionId& out);

// take_…() read the number at `at`, and move `at` to the first character after the number. This
// character must exist, such as the comma or semicolon in a datagram. False: no valid number.
bool take_number(const char*& at, std::uint32_t& out);
bool take_number(const char*& at, std::int32_t& out);
bool take_hundredths(const char*& at, std::int32_t& out);  // as parse_hundredths(), of any length

// The longest text that a writer below produces: the 20 digits of a 64-bit number.
constexpr std::size_t max_number_text = 20;

// Writers write the shortest form to `out`, which must have room for max_number_text characters.
// Writers return the position after the last character and write no NUL.
char* write_number(char* out, std::uint32_t value);
char* write_number(char* out, std::uint64_t value);
char* write_number(char* out, std::int32_t value);
char* write_hundredths(char* out, std::int32_t hundredths);  // always two decimals: "1.00"
char* write_hex(char* out, std::uint32_t value);             // lower case, no leading zeros
// Two lower-case digits for each byte; `out` must have room for the digits.
char* write_hex(char* out, const std::uint8_t* bytes, std::size_t size);
char* write_session_id(char* out, SessionId sid);  // session_id_size characters

// --- inline, because a state has many numbers

// The digit's value; above 9 if `c` is not a digit.
constexpr unsigned digit_value(char c) { return unsigned{static_cast<unsigned char>(c)} - '0'; }
constexpr bool is_decimal_digit(char c) { return digit_value(c) <= 9; }
// One to nine digits always fit, and need no 64-bit arithmetic.
constexpr bool fits_32_bits(std::size_t digits) { return digits - 1 < 9; }

inline bool take_number(const char*& at, std::uint32_t& out) {
  const char* const first = at;
  std::uint32_t value = 0;
  for (; is_decimal_digit(*at); ++at) value = value * 10 + digit_value(*at);
  const auto size = static_cast<std::size_t>(at - first);
  if (!fits_32_bits(size)) return parse_number(Text(first, size), out);
  out = value;
  return true;
}

inline bool take_number(const char*& at, std::int32_t& out) {
  const std::uint32_t minus = *at == '-' ? 1 : 0;
  at += minus;
  std::uint32_t magnitude = 0;
  if (!take_number(at, magnitude) || magnitude > 0x7FFFFFFFU + minus) return false;
  out = static_cast<std::int32_t>(minus != 0 ? 0U - magnitude : magnitude);
  return true;
}

inline bool take_hundredths(const char*& at, std::int32_t& out) {
  constexpr std::uint32_t max_units = 19999999;
  const bool negative = *at == '-';
  at += negative ? 1 : 0;
  std::uint32_t magnitude = 0;
  if (!take_number(at, magnitude) || magnitude > max_units) return false;
  magnitude *= 100;
  if (*at == '.') {
    if (!is_decimal_digit(*++at)) return false;
    magnitude += 10 * digit_value(*at);
    if (is_decimal_digit(*++at)) magnitude += digit_value(*at);
    while (is_decimal_digit(*at)) ++at;
  }
  const auto value = static_cast<std::int32_t>(magnitude);
  out = negative ? -value : value;
  return true;
}

}  // namespace r4
