// SPDX-License-Identifier: GPL-3.0-or-later
// One text for the URLs of many boards:
//
//     can://can0?node=0-7        udp://127.0.0.1:20000-20999        udp://10.0.0.{1-250}, udp://arm-{1,3,07-12}
//
// A range of nodes or of ports needs no braces. Of several braces the last counts fastest. A number that begins with 0
// keeps its width: {07-12} is 07, 08 …
//
// And for those of several paths to one board (docs/redundancy.md):
//
//     serial:auto+udp://192.168.0.125          can://can0?node=0-7+can://can1?node=0-7
//
// A '+' joins only where the scheme of a URL and its colon follow; elsewhere it is a character as any other, and %2B is
// one everywhere. Of patterns each part stands for as many: the first board has the first of each, and so on. A part that
// is no pattern cannot lead to several boards.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace r4 {

struct PatternUrl {
  std::string url;     // of several paths: joined
  std::string number;  // what the pattern has become, "7" or "3-7"; empty where the text is a URL
};

// More are a mistake in typing.
constexpr std::size_t most_pattern_urls = 10'000;

// What it stands for, in order; a URL stands for itself. Throws Error{usage} for braces and ranges that are none,
// for more than most_pattern_urls, and for what is then no URL.
std::vector<PatternUrl> expand_urls(std::string_view pattern);
// Of several texts, each of other boards: throws Error{usage} for a URL that is there twice, too.
std::vector<PatternUrl> expand_urls(const std::vector<std::string>& patterns);

// The URLs of the paths that a text joins; of one URL that alone. They are not looked at.
std::vector<std::string> split_paths(std::string_view text);
std::string join_paths(const std::vector<std::string>& urls);
// Has one of them that scheme?
bool has_path(std::string_view text, std::string_view scheme);

}  // namespace r4
