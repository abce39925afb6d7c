// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/r4/ros2/graph/pressed.hpp"

#include <gtest/gtest.h>

namespace r4::tool::ros2 {
namespace {

EntityId number(int n) {
  return {static_cast<std::uint8_t>(n), static_cast<std::uint8_t>(n >> 8), 1};
}

TEST(Ros2Pressed, CountsOnceUntilItIsReleased) {
  Pressed pressed;
  EXPECT_FALSE(pressed.on(number(1), false));
  EXPECT_TRUE(pressed.on(number(1), true));
  EXPECT_FALSE(pressed.on(number(1), true)) << "a repeated message is not a new press";
  EXPECT_TRUE(pressed.on(number(2), true)) << "another publisher has pressed";
  EXPECT_FALSE(pressed.on(number(1), false));
  EXPECT_TRUE(pressed.on(number(1), true));
}

TEST(Ros2Pressed, ForgetsThePublisherSilentForLongest) {
  Pressed pressed;
  for (int n = 0; n < static_cast<int>(Pressed::most); ++n)
    EXPECT_TRUE(pressed.on(number(n), true));
  EXPECT_FALSE(pressed.on(number(0), true)) << "this publisher is the newest";
  EXPECT_TRUE(pressed.on(number(1000), true));
  EXPECT_FALSE(pressed.on(number(0), true));
  EXPECT_TRUE(pressed.on(number(1), true)) << "the oldest publisher must be forgotten";
}

}  // namespace
}  // namespace r4::tool::ros2
