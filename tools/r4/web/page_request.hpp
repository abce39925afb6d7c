// SPDX-License-Identifier: GPL-3.0-or-later
// What a page asks r4 web for, read from its JSON. Nothing that it sends is trusted.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace r4::tool::web {

struct PageRequest {
  enum class Kind : std::uint8_t { control, alive, command, arm, clear, stop, record };
  Kind kind = Kind::alive;
  bool on = false;            // control: wanted; record
  std::uint64_t request = 0;  // the page's number of it, for the result
  std::size_t board = 0;      // command, arm, clear
  std::uint64_t now = 0;      // alive: the newest that the page has heard
  std::string command;        // "O:358,1,1"
};

// None for what is not one of these messages, with all of its members and in their ranges.
std::optional<PageRequest> page_request(const std::string& text);

}  // namespace r4::tool::web
