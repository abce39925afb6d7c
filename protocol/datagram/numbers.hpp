// SPDX-License-Identifier: GPL-3.0-or-later
// The one place where numbers are read from text and written to it.
//
// Reading is strict: the whole text must be the number, with no blanks and no '+'; a value that
// does not fit its type is refused. Every reader returns false and leaves `out` alone on refusal.
#pragma once

#include <cstddef>
#include <cstdint>

#include "r4link/text.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {

bool parse_number(Text text, std::uint32_t& out);
bool parse_number(Text text, std::uint64_t& out);
bool parse_number(Text text, std::int32_t& out);

// Is it digits, perhaps behind a '-', of whatever size? Tells a number that does not fit its type
// (out of range) from what is no number (a wrong form).
bool is_whole_number(Text text);

// A decimal such as "24.28", "-0.5" or "12" as hundredths of its unit (2428, -50, 1200). Further
// decimals are cut off. |value| must stay below 20 million units.
bool parse_hundredths(Text text, std::int32_t& out);

// 1 to 8 hexadecimal digits, either case, leading zeros allowed.
bool parse_hex(Text text, std::uint32_t& out);
// Bytes, two digits each: `size` of them, neither more nor fewer. `out` is written on refusal, too.
bool parse_hex(Text text, std::uint8_t* out, std::size_t size);

// A session id: 16 lower-case hexadecimal digits, not all of them 0. `out` is written on refusal, too.
constexpr std::size_t session_id_size = 16;
bool parse_session_id(Text text, SessionId& out);

// The longest text that a writer below produces ("-2147483648", 20 digits of a 64-bit number).
constexpr std::size_t max_number_text = 20;

// Writers put the shortest form at `out`, which must have room for max_number_text characters, and
// return the position behind the last character. No NUL is written.
char* write_number(char* out, std::uint32_t value);
char* write_number(char* out, std::uint64_t value);
char* write_number(char* out, std::int32_t value);
char* write_hundredths(char* out, std::int32_t hundredths);  // always two decimals: "1.00"
char* write_hex(char* out, std::uint32_t value);             // lower case, no leading zeros
// Bytes, two digits each, lower case; `out` must have room for them.
char* write_hex(char* out, const std::uint8_t* bytes, std::size_t size);
char* write_session_id(char* out, SessionId sid);  // session_id_size characters

}  // namespace r4
