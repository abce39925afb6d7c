// SPDX-License-Identifier: GPL-3.0-or-later
// Expands the two URLs or patterns of a bridge to pairs of URLs.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace r4 {

struct BridgedUrls {
  std::string hosts;
  std::string board;
};

// Throws Error{usage} for patterns that give different numbers of URLs, a side with several paths,
// two equal sides, and a transport that cannot serve its side.
std::vector<BridgedUrls> pair_urls(std::string_view hosts, std::string_view board);

// True if only programs of this computer, or devices plugged into it, reach the hosts' side.
bool is_of_this_computer(const std::string& hosts);

}  // namespace r4
