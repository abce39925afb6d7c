// SPDX-License-Identifier: GPL-3.0-or-later
// One text for the URLs of many boards:
//     can://can0?node=0-7                      udp://127.0.0.1:20000-20999
//     udp://10.0.0.{1-250}                     udp://arm-{1,3,07-12}
//
// A range of nodes or of ports needs no braces. With several braces, the last number counts
// fastest. A number that begins with 0 keeps its width: {07-12} is 07, 08 …
//
// One text also joins several paths to one board (docs/how-to/redundancy.md):
//     serial:auto+udp://192.168.0.125          can://can0?node=0-7+can://can1?node=0-7
//
// A '+' joins only before the scheme of a URL and its colon. Elsewhere '+' is an ordinary
// character, and %2B always is. All patterns of a text must stand for the same number of URLs.
// Board n has URL n of each pattern. Without a pattern, a part names one board.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "../config.hpp"

namespace r4 {

struct PatternUrl {
  std::string url;     // with several paths: joined by '+'
  std::string number;  // the numbers in place of the pattern, "7" or "3-7"; empty without a pattern
};

// A larger number is probably a typing mistake.
constexpr std::size_t most_pattern_urls = 10'000;

// The URLs that a pattern stands for, in order; a URL stands for itself. Throws Error{usage} for
// invalid braces and ranges, for more than most_pattern_urls, and if a result is not a valid URL.
R4LINK_API std::vector<PatternUrl> expand_urls(std::string_view pattern);
// The URLs of all patterns. Also throws Error{usage} for a duplicate URL.
R4LINK_API std::vector<PatternUrl> expand_urls(const std::vector<std::string>& patterns);

// The URLs of a text such as "URL+URL". The URLs are not checked.
R4LINK_API std::vector<std::string> split_paths(std::string_view text);
R4LINK_API std::string join_paths(const std::vector<std::string>& urls);
// True if one of the joined URLs has the scheme.
R4LINK_API bool has_path(std::string_view text, std::string_view scheme);

}  // namespace r4
