// SPDX-License-Identifier: GPL-3.0-or-later
// A key that a board and its hosts share (docs/reference/protocol.md "Authentication"), as text:
//     <id>:<64 hexadecimal digits>      "1:00112233…", the id 1-9
//
// A key file and the setting `key` hold this text.
#pragma once

#include <cstddef>
#include <cstdint>

#include "config.hpp"
#include "text.hpp"
#include "vocabulary.hpp"

namespace r4 {

constexpr std::size_t key_size = 32;
constexpr std::uint8_t max_key_id = 9;
constexpr int max_keys = 4;  // keys of a board

struct Key {
  std::uint8_t id = 0;  // 1-9; 0: no key
  std::uint8_t bytes[key_size] = {};
};
R4LINK_API bool operator==(const Key& a, const Key& b);
inline bool operator!=(const Key& a, const Key& b) { return !(a == b); }

// Refusal::format: not this form; ::range: the id is not 1-9. `out` is written only on success.
R4LINK_API Refusal parse_key(Text text, Key& out);
// Splits "<id>:<rest>", with the refusals of parse_key().
R4LINK_API Refusal split_key(Text text, std::uint8_t& id, Text& rest);

constexpr std::size_t key_text_size = 2 + 2 * key_size;
// Writes key_text_size characters without a NUL, and returns the position after them.
R4LINK_API char* write_key(char* out, const Key& key);

}  // namespace r4
