// SPDX-License-Identifier: GPL-3.0-or-later
#include "signing.hpp"

#include "datagrams.hpp"

namespace r4::test {

Key key_of(std::uint8_t id, std::uint8_t first) {
  Key key;
  key.id = id;
  for (std::uint8_t& byte : key.bytes) byte = first++;
  return key;
}

std::string with_signature(std::string_view fields, const Key& key, std::string_view nonce,
                           std::uint64_t counter, std::uint32_t board_t) {
  const std::string before = std::string(fields) + "A:" + std::to_string(key.id) + "," +
                             std::to_string(counter) + "," + std::to_string(board_t);
  char tag[tag_size];
  write_tag(signing_key(key), Text(nonce), Text(before), tag);
  return before + "," + std::string(tag, tag_size) + ";";
}

}  // namespace r4::test
