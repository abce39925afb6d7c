// SPDX-License-Identifier: GPL-3.0-or-later
// Keys for tests, and datagrams signed with them.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "protocol/keys/authentication.hpp"
#include "protocol/messages/settings.hpp"

namespace r4::test {

// The bytes first, first + 1 …
Key key_of(std::uint8_t id, std::uint8_t first = 0);

template <class... Keys>
Settings settings_with(const Keys&... keys) {
  Settings settings;
  int i = 0;
  ((settings.site.keys[i++] = keys), ...);
  return settings;
}

// `fields` ("O:358,1,1;PNum:7;T:1;") with their signature for the given counter and board T.
std::string with_signature(std::string_view fields, const Key& key, std::string_view nonce,
                           std::uint64_t counter, std::uint32_t board_t);

}  // namespace r4::test
