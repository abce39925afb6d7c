// SPDX-License-Identifier: GPL-3.0-or-later
// The grammar of URLs as two tables: accepted URLs with their parts, and refused URLs with the
// reason.
#include "r4link/discovery/url.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

struct Accepted {
  std::string text, scheme, host;
  int port;  // -1: none
  std::string path;
};

const std::vector<Accepted> accepted = {
    {"udp://192.168.1.77", "udp", "192.168.1.77", -1, ""},
    {"udp://192.168.1.77:2018", "udp", "192.168.1.77", 2018, ""},
    {"udp://r4-board.local:1", "udp", "r4-board.local", 1, ""},
    {"udp://my_board:65535", "udp", "my_board", 65535, ""},
    {"udp://0.0.0.0:0", "udp", "0.0.0.0", 0, ""},
    {"udp://[::1]", "udp", "::1", -1, ""},
    {"udp://[fe80::1%eth0]:2018", "udp", "fe80::1%eth0", 2018, ""},
    {"UDP://host", "udp", "host", -1, ""},
    {"udp://host?listen=0", "udp", "host", -1, ""},
    {"udp://host:7/path", "udp", "host", 7, "/path"},
    {"udp://", "udp", "", -1, ""},
    {"serial:auto", "serial", "", -1, "auto"},
    {"serial:?sn=0042", "serial", "", -1, ""},
    {"serial:///dev/ttyACM0", "serial", "", -1, "/dev/ttyACM0"},
    {"serial:/dev/ttyACM0", "serial", "", -1, "/dev/ttyACM0"},
    {"serial:///dev/serial/by-id/usb-Arduino_Giga:1-if00", "serial", "", -1,
     "/dev/serial/by-id/usb-Arduino_Giga:1-if00"},
    {"pty:", "pty", "", -1, ""},
    {"pty:/tmp/r4", "pty", "", -1, "/tmp/r4"},
    {"pty:/tmp/with blank", "pty", "", -1, "/tmp/with blank"},
    {"pty:/tmp/with%20blank%3f", "pty", "", -1, "/tmp/with blank?"},
    {"sim:", "sim", "", -1, ""},
    {"sim:?node=1&seed=2", "sim", "", -1, ""},
    {"can://can0?node=1", "can", "can0", -1, ""},
    {"replay:run.tsv?speed=2", "replay", "", -1, "run.tsv"},
};

TEST(Url, AcceptsEveryValidFormOfTheTable) {
  for (const Accepted& row : accepted) {
    SCOPED_TRACE(row.text);
    const Url url = Url::parse(row.text);
    EXPECT_EQ(url.text(), row.text);
    EXPECT_EQ(url.scheme(), row.scheme);
    EXPECT_EQ(url.host(), row.host);
    EXPECT_EQ(url.port() ? int{*url.port()} : -1, row.port);
    EXPECT_EQ(url.path(), row.path);
  }
}

struct Refused {
  std::string text, reason;  // a part of the reason
};

const std::vector<Refused> refused = {
    {"", "does not begin with a transport"},
    {"udp", "does not begin with a transport"},
    {"192.168.1.77", "does not begin with a transport"},
    {":x", "does not begin with a transport"},
    {"1udp://host", "does not begin with a transport"},
    {"u-dp://host", "does not begin with a transport"},
    {"/dev/ttyACM0", "a device, not a URL"},
    {"udp://host:", "'' is not a port"},
    {"udp://host:65536", "'65536' is not a port"},
    {"udp://host:-1", "'-1' is not a port"},
    {"udp://host:+1", "'+1' is not a port"},
    {"udp://host:2018x", "'2018x' is not a port"},
    {"udp://host: 2018", "' 2018' is not a port"},
    {"udp://fe80::1", "is not HOST or HOST:PORT"},
    {"udp://[::1", "is not closed"},
    {"udp://[::1]2018", "is not HOST or HOST:PORT"},
    {"udp://[]", "is not a host name"},
    {"udp://user@host", "is not a host name"},
    {"udp://ho st", "is not a host name"},
    {"udp://h%6fst", "is not a host name"},
    {"udp://host?", "'' is not KEY=VALUE"},
    {"udp://host?listen", "'listen' is not KEY=VALUE"},
    {"udp://host?=1", "'=1' is not KEY=VALUE"},
    {"udp://host?listen=1&", "'' is not KEY=VALUE"},
    {"udp://host?listen=1&listen=2", "'listen' is given twice"},
    {"pty:/tmp/%", "'%' is not a percent-encoded"},
    {"pty:/tmp/%4", "'%4' is not a percent-encoded"},
    {"pty:/tmp/%zz", "'%zz' is not a percent-encoded"},
    {"pty:/tmp/%00", "'%00' is not a percent-encoded"},
    {"pty:/tmp?x=%g0", "'%g0' is not a percent-encoded"},
    {"pty:/tmp\nx", "control characters"},
    {"pty:/tmp/\u202Ex", "control characters"},
    {"pty:/tmp/\xff", "control characters"},
    {std::string("pty:/tmp\0x", 10), "control characters"},
};

TEST(Url, RefusesEveryInvalidFormOfTheTableWithAReason) {
  for (const Refused& row : refused) {
    SCOPED_TRACE(row.text);
    const Problem problem = problem_of([&] { Url::parse(row.text); });
    EXPECT_EQ(problem.kind, ErrorKind::usage);
    EXPECT_TRUE(contains(problem.reason, row.reason));
    EXPECT_FALSE(problem.fix.empty());
    EXPECT_FALSE(problem.thing.empty());
  }
}

TEST(Url, ReadsTheValuesOfItsKeys) {
  const Url url = Url::parse("udp://host?listen=2390&name=a%26b%3Dc&empty=&n=-5");
  EXPECT_EQ(url.get("listen"), "2390");
  EXPECT_EQ(url.get("name"), "a&b=c");
  EXPECT_EQ(url.get("empty"), "");
  EXPECT_EQ(url.get("other"), std::nullopt);
  EXPECT_EQ(url.get_number("listen", 0, 65535, 7), 2390);
  EXPECT_EQ(url.get_number("n", -10, 10, 7), -5);
  EXPECT_EQ(url.get_number("other", 0, 10, 7), 7);
  EXPECT_THROW(url.get_number("listen", 0, 2389, 7), Error);
  EXPECT_THROW(url.get_number("listen", 2391, 9999, 7), Error);
  EXPECT_THROW(url.get_number("name", 0, 10, 7), Error);
  EXPECT_THROW(url.get_number("empty", 0, 10, 7), Error);
}

TEST(Url, DistinguishesAnInvalidNumberFromATooLargeOne) {
  const auto text = [](const char* url) {
    return problem_of([&] { Url::parse(url).get_number("node", 0, 31, 1); }).text();
  };
  EXPECT_EQ(text("can://can0?node=32"),
            "can://can0?node=32: 'node=32' is out of range; give a whole number from 0 to 31");
  EXPECT_EQ(
      text("can://can0?node=0-7"),
      "can://can0?node=0-7: 'node=0-7' is not a whole number; give a whole number from 0 to 31");
}

TEST(Url, NamesTheKeyThatATransportDoesNotHave) {
  const Url url = Url::parse("udp://host?listen=1&list=2");
  EXPECT_NO_THROW(url.allow_only("peer listen list"));
  EXPECT_EQ(problem_of([&] { url.allow_only("listen peer"); }).text(),
            "udp://host?listen=1&list=2: udp has no option 'list'; its options: listen peer");
  EXPECT_THROW(url.allow_only(""), Error);
  EXPECT_NO_THROW(Url::parse("udp://host").allow_only(""));
}

}  // namespace
}  // namespace r4::test
