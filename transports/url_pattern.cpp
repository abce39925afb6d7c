// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/discovery/url_pattern.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <set>
#include <utility>

#include "../protocol/datagram/numbers.hpp"
#include "r4link/discovery/url.hpp"
#include "r4link/error.hpp"

namespace r4 {
namespace {

[[noreturn]] void refuse_pattern(std::string_view pattern, std::string reason) {
  throw Error(ErrorKind::usage, std::string(pattern), std::move(reason),
              "write ranges as in node=0-7, :20000-20999 or {1-250}, the lower number first");
}

[[noreturn]] void refuse_as_too_many(std::string_view pattern) {
  throw Error(ErrorKind::usage, std::string(pattern),
              "stands for more than " + std::to_string(most_pattern_urls) + " boards",
              "name fewer boards in one URL");
}

bool is_decimal(char c) { return c >= '0' && c <= '9'; }
bool begins_scheme(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }

// The size of a range such as "0-7" at the beginning of the text; 0 if there is none.
std::size_t range_size(std::string_view text) {
  const auto digits = [&text](std::size_t from) {
    while (from < text.size() && is_decimal(text[from])) ++from;
    return from;
  };
  const std::size_t dash = digits(0);
  if (dash == 0 || dash == text.size() || text[dash] != '-') return 0;
  const std::size_t end = digits(dash + 1);
  return end == dash + 1 ? 0 : end;
}

void brace(std::string& text, std::size_t at) {
  const std::size_t size = range_size(std::string_view(text).substr(at));
  const std::size_t end = at + size;
  if (size == 0 || (end < text.size() && text[end] != '&' && text[end] != '?')) return;
  text.insert(end, "}");
  text.insert(at, "{");
}

std::string with_braces(std::string_view pattern) {
  std::string text(pattern);
  for (const char* key : {"?node=", "&node="}) {
    const std::size_t at = text.find(key);
    if (at != std::string::npos) brace(text, at + std::string_view(key).size());
  }
  if (text.starts_with("udp://")) {
    const std::size_t end = std::min(text.find_first_of("/?", 6), text.size());
    const std::size_t colon = text.rfind(':', end);
    if (colon != std::string::npos && colon > 5) brace(text, colon + 1);
  }
  return text;
}

// The numbers of "1,3,07-12", as text.
std::vector<std::string> numbers_of(std::string_view pattern, std::string_view list) {
  std::vector<std::string> numbers;
  for (bool more = true; more;) {
    const std::size_t comma = std::min(list.find(','), list.size());
    const std::string_view part = list.substr(0, comma);
    more = comma != list.size();
    list.remove_prefix(more ? comma + 1 : comma);
    const std::size_t dash = std::min(part.find('-'), part.size());
    const std::string_view lower = part.substr(0, dash);
    const std::string_view upper = dash == part.size() ? lower : part.substr(dash + 1);
    std::uint32_t first = 0;
    std::uint32_t last = 0;
    if (!parse_number(lower, first) || !parse_number(upper, last) || first > last) {
      refuse_pattern(pattern, "'" + std::string(part) + "' is neither a number nor a range");
    }
    if (last - first >= most_pattern_urls) refuse_as_too_many(pattern);
    const std::size_t width = lower.front() == '0' ? lower.size() : 0;
    for (std::uint32_t number = first; number <= last; ++number) {
      numbers.push_back(fmt::format("{:0{}}", number, width));
      if (numbers.size() > most_pattern_urls) refuse_as_too_many(pattern);
    }
  }
  return numbers;
}

std::vector<PatternUrl> expand_path(std::string_view pattern) {
  std::vector<PatternUrl> all{{"", ""}};
  std::string text = with_braces(pattern);
  std::string_view rest = text;
  while (true) {
    const std::size_t open = rest.find('{');
    const std::size_t close = rest.find('}');
    if (open == std::string_view::npos && close == std::string_view::npos) break;
    if (open == std::string_view::npos || close == std::string_view::npos || close < open) {
      refuse_pattern(pattern, "has a brace without its partner");
    }
    const std::vector<std::string> numbers =
        numbers_of(pattern, rest.substr(open + 1, close - open - 1));
    if (all.size() * numbers.size() > most_pattern_urls) refuse_as_too_many(pattern);
    std::vector<PatternUrl> more;
    more.reserve(all.size() * numbers.size());
    for (const PatternUrl& each : all) {
      for (const std::string& number : numbers) {
        more.push_back({each.url + std::string(rest.substr(0, open)) + number,
                        each.number.empty() ? number : each.number + "-" + number});
      }
    }
    all = std::move(more);
    rest.remove_prefix(close + 1);
  }
  for (PatternUrl& each : all) {
    each.url += rest;
    Url::parse(each.url);
  }
  return all;
}

}  // namespace

std::vector<PatternUrl> expand_urls(std::string_view pattern) {
  std::vector<PatternUrl> boards;
  for (const std::string& path : split_paths(pattern)) {
    std::vector<PatternUrl> urls = expand_path(path);
    if (boards.empty()) {
      boards = std::move(urls);
      continue;
    }
    if (urls.size() != boards.size()) {
      throw Error(ErrorKind::usage, std::string(pattern),
                  "the paths lead to " + std::to_string(boards.size()) + " and to " +
                      std::to_string(urls.size()) + " boards",
                  "give each path a range of the same length, as in "
                  "can://can0?node=0-7+can://can1?node=0-7");
    }
    for (std::size_t i = 0; i < boards.size(); ++i) boards[i].url += "+" + urls[i].url;
  }
  return boards;
}

std::vector<PatternUrl> expand_urls(const std::vector<std::string>& patterns) {
  std::vector<PatternUrl> boards;
  std::set<std::string> seen;
  for (const std::string& pattern : patterns) {
    for (PatternUrl& each : expand_urls(pattern)) {
      if (!seen.insert(each.url).second) {
        throw Error(ErrorKind::usage, each.url, "the board is named twice", "name each board once");
      }
      boards.push_back(std::move(each));
    }
  }
  return boards;
}

std::vector<std::string> split_paths(std::string_view text) {
  std::vector<std::string> urls;
  std::size_t begin = 0;
  for (std::size_t plus = text.find('+'); plus != std::string_view::npos;
       plus = text.find('+', plus + 1)) {
    std::size_t end = plus + 1;
    while (end < text.size() && (begins_scheme(text[end]) || is_decimal(text[end]))) ++end;
    if (end == text.size() || text[end] != ':' || !begins_scheme(text[plus + 1])) continue;
    urls.emplace_back(text.substr(begin, plus - begin));
    begin = plus + 1;
  }
  urls.emplace_back(text.substr(begin));
  return urls;
}

bool has_path(std::string_view text, std::string_view scheme) {
  const std::vector<std::string> urls = split_paths(text);
  return std::any_of(urls.begin(), urls.end(), [scheme](const std::string& url) {
    return Url::parse(url).scheme() == scheme;
  });
}

std::string join_paths(const std::vector<std::string>& urls) {
  std::string text;
  for (const std::string& url : urls) text += (text.empty() ? "" : "+") + url;
  return text;
}

}  // namespace r4
