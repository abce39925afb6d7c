// SPDX-License-Identifier: GPL-3.0-or-later
#include "transports/share/share_message.hpp"

#include <gtest/gtest.h>

#include <string>

namespace r4::test {
namespace {

using Letter = ShareMessage::Kind;

std::string packet_of(Letter kind, const std::string& text = {}) {
  return static_cast<char>(kind) + text;
}

TEST(ShareMessage, OfAHelloTellsRoleAndName) {
  for (const BoardRole role : {BoardRole::control, BoardRole::watch}) {
    const std::string bytes = packet_of(Letter::hello, hello_text(role, "r4"));
    const auto message = read_share_message(bytes);
    ASSERT_TRUE(message);
    EXPECT_EQ(message->kind, Letter::hello);
    EXPECT_EQ(message->role, role);
    EXPECT_EQ(message->text, "r4");
  }
}

TEST(ShareMessage, OfAnotherVersionIsToldFromDamage) {
  const auto message = read_share_message("h9whatever comes next");
  ASSERT_TRUE(message);
  EXPECT_FALSE(message->same_version);
  EXPECT_TRUE(message->text.empty());
}

TEST(ShareMessage, BringsAProblemWhole) {
  const Problem problem{ErrorKind::permission, "/dev/ttyACM0", "permission denied", "join dialout"};
  const std::string bytes = packet_of(Letter::down, problem_text(problem));
  const auto message = read_share_message(bytes);
  ASSERT_TRUE(message);
  EXPECT_EQ(message->problem.text(), problem.text());
  EXPECT_EQ(message->problem.kind, ErrorKind::permission);
}

TEST(ShareMessage, CutsWhatIsTooLong) {
  const std::string much(5000, 'x');
  EXPECT_TRUE(read_share_message(packet_of(Letter::welcome, welcome_text(much))));
  EXPECT_TRUE(read_share_message(packet_of(Letter::hello, hello_text(BoardRole::watch, much))));
  const std::string bytes =
      packet_of(Letter::warning, problem_text({ErrorKind::open, much, much, much}));
  ASSERT_LE(bytes.size(), ShareMessage::max_size);
  const auto message = read_share_message(bytes);
  ASSERT_TRUE(message);
  EXPECT_GT(message->problem.fix.size(), 300U);
}

TEST(ShareMessage, OfADatagramIsAnyBytes) {
  const std::string bytes = packet_of(Letter::received, std::string("\0\xff;", 3));
  const auto message = read_share_message(bytes);
  ASSERT_TRUE(message);
  EXPECT_EQ(message->text, std::string("\0\xff;", 3));
}

TEST(ShareMessage, IsRefusedWhereItIsNone) {
  const std::string longest(max_datagram, 'x');
  EXPECT_TRUE(read_share_message(packet_of(Letter::sent, longest)));
  for (const std::string& bad : {
           std::string(),
           std::string("x"),
           packet_of(Letter::sent),
           packet_of(Letter::sent, longest + "x"),
           packet_of(Letter::hello),
           packet_of(Letter::hello, "2"),
           packet_of(Letter::hello, "2x"),
           packet_of(Letter::hello, "2w"),
           packet_of(Letter::hello, "2xr4"),
           packet_of(Letter::welcome, "2"),
           packet_of(Letter::welcome, "2\033[2J"),
           packet_of(Letter::busy),
           packet_of(Letter::busy, "a\nb"),
           packet_of(Letter::yours, "x"),
           packet_of(Letter::moved, "x"),
           packet_of(Letter::alive, "x"),
           packet_of(Letter::up),
           packet_of(Letter::up, "udp://\x07"),
           packet_of(Letter::down),
           packet_of(Letter::down, "4"),
           packet_of(Letter::down, std::string("4a\0b", 4)),
           packet_of(Letter::down, std::string("0a\0b\0c", 6)),
           packet_of(Letter::down, std::string("7a\0b\0c", 6)),
           packet_of(Letter::warning, std::string("4a\0\x1b\0c", 6)),
       }) {
    EXPECT_FALSE(read_share_message(bad)) << bad;
  }
  EXPECT_TRUE(read_share_message(packet_of(Letter::down, std::string("4a\0b\0", 5))))
      << "without a fix";
}

}  // namespace
}  // namespace r4::test
