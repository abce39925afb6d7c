// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/key.hpp"

#include "../datagram/numbers.hpp"

namespace r4 {

bool operator==(const Key& a, const Key& b) {
  return a.id == b.id && std::memcmp(a.bytes, b.bytes, key_size) == 0;
}

Refusal split_key(Text text, std::uint8_t& id, Text& rest) {
  std::size_t colon = 0;
  while (colon < text.size() && text[colon] != ':') ++colon;
  std::uint32_t number = 0;
  if (colon == text.size() || !is_whole_number(text.substr(0, colon))) return Refusal::format;
  if (!parse_number(text.substr(0, colon), number) || number < 1 || number > max_key_id) {
    return Refusal::range;
  }
  id = static_cast<std::uint8_t>(number);
  rest = text.substr(colon + 1);
  return Refusal::none;
}

Refusal parse_key(Text text, Key& out) {
  Key key;
  Text digits;
  const Refusal refusal = split_key(text, key.id, digits);
  if (refusal != Refusal::none) return refusal;
  if (!parse_hex(digits, key.bytes, key_size)) return Refusal::format;
  out = key;
  return Refusal::none;
}

char* write_key(char* out, const Key& key) {
  out = write_number(out, std::uint32_t{key.id});
  *out++ = ':';
  return write_hex(out, key.bytes, key_size);
}

}  // namespace r4
