// SPDX-License-Identifier: GPL-3.0-or-later
// A request of a page, parsed from JSON. The input is not trusted.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace r4::tool::web {

struct PageRequest {
  enum class Kind : std::uint8_t { control, alive, command, arm, clear, stop, record };
  Kind kind = Kind::alive;
  bool on = false;            // control and record
  std::uint64_t request = 0;  // the page's number, repeated in the result
  std::size_t board = 0;      // command, arm, clear
  std::uint64_t now = 0;      // alive: newest server time received by the page
  std::string command;
};

std::optional<PageRequest> page_request(const std::string& text);

}  // namespace r4::tool::web
