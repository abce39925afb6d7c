// SPDX-License-Identifier: GPL-3.0-or-later
#include "transports/share/share_message.hpp"

#include <gtest/gtest.h>

#include <string>

namespace r4::test {
namespace {

using Letter = ShareMessage::Kind;

TEST(ShareMessage, PreservesAnEvent) {
  const Problem problem{ErrorKind::permission, "/dev/ttyACM0", "permission denied", "join dialout"};
  for (const auto kind :
       {CarrierEvent::Kind::up, CarrierEvent::Kind::down, CarrierEvent::Kind::warning}) {
    const auto message = read_share_message("e" + text_of({kind, problem}));
    ASSERT_TRUE(message);
    EXPECT_EQ(message->kind, Letter::event);
    EXPECT_EQ(message->event.kind, kind);
    EXPECT_EQ(message->event.problem.text(), problem.text());
    EXPECT_EQ(message->event.problem.kind, ErrorKind::permission);
  }
}

TEST(ShareMessage, MakesTheTextsOfAnEventPrintable) {
  const auto message = read_share_message({"ed4a\x07\0\x1b\0c\n", 10});
  ASSERT_TRUE(message);
  EXPECT_EQ(message->event.problem.thing, "a\\x07");
  EXPECT_EQ(message->event.problem.reason, "\\x1b");
  EXPECT_EQ(message->event.problem.fix, "c\\x0a");
}

TEST(ShareMessage, CutsTextsThatAreTooLong) {
  const std::string much(5000, 'x');
  const std::string packet =
      "e" + text_of({CarrierEvent::Kind::down, {ErrorKind::open, much, much, much}});
  ASSERT_LE(packet.size(), ShareMessage::max_size);
  const auto message = read_share_message(packet);
  ASSERT_TRUE(message);
  EXPECT_GT(message->event.problem.fix.size(), 300U);
}

TEST(ShareMessage, IsReadIfItIsValidAndOfThisVersion) {
  const std::string longest(max_datagram, 'x');
  for (const std::string& good :
       {"s" + longest, std::string("r\0\xff;", 4), std::string("h3"), std::string("c3"),
        std::string("w3"), std::string("ed4a\0b\0", 7)}) {
    const auto message = read_share_message(good);
    ASSERT_TRUE(message) << good;
    EXPECT_EQ(message->text, good.substr(1));
  }
  for (const std::string& bad : {
           std::string(),
           std::string("x"),
           std::string("s"),
           "s" + longest + "x",
           std::string("h"),
           std::string("h2"),
           std::string("h33"),
           std::string("c9whatever comes next"),
           std::string("w2r4"),
           std::string("e"),
           std::string("ed"),
           std::string("ed4"),
           std::string("ed4a\0b", 6),
           std::string("ed0a\0b\0c", 8),
           std::string("ed7a\0b\0c", 8),
           std::string("ex4a\0b\0c", 8),
       }) {
    EXPECT_FALSE(read_share_message(bad)) << bad;
  }
}

}  // namespace
}  // namespace r4::test
