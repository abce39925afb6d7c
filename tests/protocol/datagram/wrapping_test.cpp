// SPDX-License-Identifier: GPL-3.0-or-later
#include "protocol/datagram/wrapping.hpp"

#include <gtest/gtest.h>

namespace r4 {
namespace {

TEST(Wrapping, APastTimeStaysInThePastForever) {
  std::uint32_t now = 0xFFFFFF00;
  std::uint32_t past = now - 1;
  for (int day = 0; day < 100; ++day) {
    now += 86400000;
    keep_near(past, now);
    EXPECT_TRUE(newer(now, past)) << day;
  }
}

TEST(Wrapping, RecentAndFutureTimesStayUnchanged) {
  for (const std::uint32_t now : {0U, 5U, 0x7FFFFFFFU, 0xFFFFFFFFU}) {
    for (const std::uint32_t apart : {0U, 1U, 200U, long_ago - 1}) {
      std::uint32_t past = now - apart;
      keep_near(past, now);
      EXPECT_EQ(past, now - apart);
      std::uint32_t future = now + apart;
      keep_near(future, now);
      EXPECT_EQ(future, now + apart);
    }
  }
}

}  // namespace
}  // namespace r4
