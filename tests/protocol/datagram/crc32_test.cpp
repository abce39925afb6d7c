// SPDX-License-Identifier: GPL-3.0-or-later
#include "protocol/datagram/crc32.hpp"

#include <gtest/gtest.h>

#include <random>
#include <string>

namespace r4 {
namespace {

TEST(Crc32, MatchesTheCheckValueOfTheCatalogue) {
  EXPECT_EQ(crc32("123456789"), 0xCBF43926U);
  EXPECT_EQ(crc32_table("123456789"), 0xCBF43926U);
}

TEST(Crc32, MatchesTheHeartbeatOfThePaper) {
  EXPECT_EQ(crc32("H:R4-ROS2;PNum:0;T:0;^"), 0xB10B3A06U);
}

TEST(Crc32, AnEmptyTextLeavesTheChecksumUnchanged) {
  EXPECT_EQ(crc32(Text()), 0U);
  EXPECT_EQ(crc32_table(Text()), 0U);
  EXPECT_EQ(crc32(Text(), 0x12345678U), 0x12345678U);
  EXPECT_EQ(crc32_table(Text(), 0x12345678U), 0x12345678U);
}

TEST(Crc32, FastAndTableFormAgreeAtEveryLengthAndCut) {
  std::mt19937 random(1);
  std::string bytes(1100, '\0');
  for (char& byte : bytes) byte = static_cast<char>(random());
  for (std::size_t size = 0; size <= bytes.size(); ++size) {
    const Text text(bytes.data(), size);
    const std::size_t cut = size == 0 ? 0 : random() % (size + 1);
    const std::uint32_t whole = crc32_table(text);
    ASSERT_EQ(crc32(text), whole) << size;
    ASSERT_EQ(crc32(text.substr(cut), crc32(text.substr(0, cut))), whole) << size << ' ' << cut;
    ASSERT_EQ(crc32_table(text.substr(cut), crc32_table(text.substr(0, cut))), whole) << size;
  }
}

}  // namespace
}  // namespace r4
