// SPDX-License-Identifier: GPL-3.0-or-later
// One text for the URLs of many boards:
//
//     can://can0?node=0-7        udp://127.0.0.1:20000-20999        udp://10.0.0.{1-250}, udp://arm-{1,3,07-12}
//
// A range of nodes or of ports needs no braces. Of several braces the last counts fastest. A number that begins with 0
// keeps its width: {07-12} is 07, 08 …
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace r4 {

struct PatternUrl {
  std::string url;
  std::string number;  // what the pattern has become, "7" or "3-7"; empty where the text is a URL
};

// More are a mistake in typing.
constexpr std::size_t most_pattern_urls = 10'000;

// What it stands for, in order; a URL stands for itself. Throws Error{usage} for braces and ranges that are none,
// for more than most_pattern_urls, and for what is then no URL.
std::vector<PatternUrl> expand_urls(std::string_view pattern);

}  // namespace r4
