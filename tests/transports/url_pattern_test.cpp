// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/discovery/url_pattern.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

using Texts = std::vector<std::string>;

Texts urls_of(std::string_view pattern) {
  Texts urls;
  for (const PatternUrl& each : expand_urls(pattern)) urls.push_back(each.url);
  return urls;
}

TEST(UrlPattern, AUrlWithoutAPatternIsUnchanged) {
  for (const char* url :
       {"udp://192.168.0.125", "udp://[fe80::1]:2018", "serial:///dev/serial/by-id/usb-R4-1-if00",
        "can://can0?node=3&fd=1", "sim:", "udp:?id=arm-1-3", "udp://robot-1-3", "pty:/tmp/a-1-2"}) {
    const std::vector<PatternUrl> all = expand_urls(url);
    ASSERT_EQ(all.size(), 1U) << url;
    EXPECT_EQ(all[0].url, url);
    EXPECT_EQ(all[0].number, "") << url;
  }
}

TEST(UrlPattern, RangesOfNodesAndPortsNeedNoBraces) {
  EXPECT_EQ(urls_of("can://can0?node=2-4"),
            (Texts{"can://can0?node=2", "can://can0?node=3", "can://can0?node=4"}));
  EXPECT_EQ(urls_of("can://can0?fd=1&node=0-1&pack=0"),
            (Texts{"can://can0?fd=1&node=0&pack=0", "can://can0?fd=1&node=1&pack=0"}));
  EXPECT_EQ(urls_of("udp://127.0.0.1:9-11?listen=0"),
            (Texts{"udp://127.0.0.1:9?listen=0", "udp://127.0.0.1:10?listen=0",
                   "udp://127.0.0.1:11?listen=0"}));
  EXPECT_EQ(urls_of("udp://[::1]:9-10"), (Texts{"udp://[::1]:9", "udp://[::1]:10"}));
  EXPECT_EQ(urls_of("udp://127.0.0.1:20000-20999").size(), 1000U);
}

TEST(UrlPattern, BracesTakeNumbersAndRangesAndTheLastCountsFastest) {
  EXPECT_EQ(urls_of("udp://arm-{1,3,09-11}"),
            (Texts{"udp://arm-1", "udp://arm-3", "udp://arm-09", "udp://arm-10", "udp://arm-11"}));
  const std::vector<PatternUrl> all = expand_urls("can://can{0-1}?node=0-2");
  ASSERT_EQ(all.size(), 6U);
  EXPECT_EQ(all[0].url, "can://can0?node=0");
  EXPECT_EQ(all[1].url, "can://can0?node=1");
  EXPECT_EQ(all[5].url, "can://can1?node=2");
  EXPECT_EQ(all[5].number, "1-2");
  EXPECT_EQ(expand_urls("udp://10.0.0.{1-250}")[6].number, "7");
}

TEST(UrlPattern, APlusBeforeAUrlJoinsPaths) {
  struct Joined {
    const char* text;
    std::vector<std::string> urls;
  };
  for (const auto& [text, urls] : std::vector<Joined>{
           {"serial:auto", {"serial:auto"}},
           {"serial:auto+udp://10.0.0.1", {"serial:auto", "udp://10.0.0.1"}},
           {"can://can0?node=3&fd=1+can://can1?node=3+udp:auto",
            {"can://can0?node=3&fd=1", "can://can1?node=3", "udp:auto"}},
           {"serial:///dev/a+b", {"serial:///dev/a+b"}},
           {"serial:///dev/a+b+serial:///dev/c+1:2",
            {"serial:///dev/a+b", "serial:///dev/c+1:2"}},  // no scheme begins with a digit
           {"serial:///dev/a%2Budp:b", {"serial:///dev/a%2Budp:b"}},
           {"udp:?id=a+", {"udp:?id=a+"}},
           {"udp:auto+serial:", {"udp:auto", "serial:"}},
           {"+udp:auto", {"", "udp:auto"}},  // Url refuses the empty text
           {"", {""}},
       }) {
    EXPECT_EQ(split_paths(text), urls) << text;
    EXPECT_EQ(join_paths(urls), text[0] == '+' ? text + 1 : text);
  }
}

TEST(UrlPattern, EachBoardGetsTheNextUrlOfEachJoinedPattern) {
  EXPECT_EQ(urls_of("serial:auto+udp://10.0.0.1"), (Texts{"serial:auto+udp://10.0.0.1"}));
  EXPECT_EQ(urls_of("can://can0?node=0-1+can://can1?node=2-3"),
            (Texts{"can://can0?node=0+can://can1?node=2", "can://can0?node=1+can://can1?node=3"}));
  EXPECT_EQ(expand_urls("can://can0?node=5-7+udp://arm-{1-3}")[2].number, "7");
}

TEST(UrlPattern, RefusesAnInvalidPatternWithTheReason) {
  struct Refused {
    const char* pattern;
    const char* reason;
  };
  for (const Refused& each : {
           Refused{"can://can0?node=7-0", "'7-0' is neither a number nor a range"},
           Refused{"udp://arm-{}", "'' is neither a number nor a range"},
           Refused{"udp://arm-{1-}", "'1-' is neither a number nor a range"},
           Refused{"udp://arm-{a-c}", "'a-c' is neither a number nor a range"},
           Refused{"udp://arm-{1,}", "'' is neither a number nor a range"},
           Refused{"udp://arm-{1-2-3}", "'1-2-3' is neither a number nor a range"},
           Refused{"udp://arm-{+1-2}", "'+1-2' is neither a number nor a range"},
           Refused{"udp://arm-{1", "has a brace without its partner"},
           Refused{"udp://arm-1}{2", "has a brace without its partner"},
           Refused{"udp://arm-{{1}}", "'{1' is neither a number nor a range"},
           Refused{"udp://10.{0-255}.{0-255}.1", "stands for more than 10000 boards"},
           Refused{"udp://arm-{0-4294967295}", "stands for more than 10000 boards"},
           Refused{"udp://127.0.0.1:65535-65536", "'65536' is not a port"},
           Refused{"can://can0?node=0-7+serial:auto", "the paths lead to 8 and to 1 boards"},
           Refused{"serial:auto+udp://arm-{1-3}", "the paths lead to 1 and to 3 boards"},
       }) {
    const Problem problem = problem_of([&] { expand_urls(each.pattern); });
    EXPECT_EQ(problem.kind, ErrorKind::usage) << each.pattern;
    EXPECT_EQ(problem.reason, each.reason) << each.pattern;
  }
}

}  // namespace
}  // namespace r4::test
