// SPDX-License-Identifier: GPL-3.0-or-later
// The two URLs or patterns of a bridge as pairs of URLs.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace r4 {

struct BridgedUrls {
  std::string hosts;
  std::string board;
};

// Throws Error{usage} for patterns of different lengths, for a side of several paths, for a side
// that would be joined to itself, and for a transport that cannot be that side.
std::vector<BridgedUrls> pair_urls(std::string_view hosts, std::string_view board);

// True if the side of hosts is reached only by programs of this computer, or by devices that are
// plugged into it.
bool is_of_this_computer(const std::string& hosts);

}  // namespace r4
