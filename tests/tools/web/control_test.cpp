// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/r4/web/control.hpp"

#include <gtest/gtest.h>

namespace r4::tool::web {
namespace {

using namespace std::chrono_literals;

TEST(WebControl, IsFreeUntilItIsTaken) {
  Control control;
  EXPECT_FALSE(control.holder());
  EXPECT_FALSE(control.deadline());
  EXPECT_FALSE(control.expired(1h));
  EXPECT_FALSE(control.alive(1, 10ms, 20ms));
  EXPECT_FALSE(control.release(1));
}

TEST(WebControl, BelongsToOneBrowserAtATime) {
  Control control;
  EXPECT_TRUE(control.take(1, 0ms));
  EXPECT_TRUE(control.take(1, 1ms));
  EXPECT_FALSE(control.take(2, 1ms));
  EXPECT_FALSE(control.release(2));
  EXPECT_TRUE(control.is_held_by(1));
}

TEST(WebControl, IsFreeWhenAllBoardsHaveConfirmedTheFarewell) {
  Control control;
  EXPECT_TRUE(control.take(1, 0ms));
  EXPECT_TRUE(control.release(1));
  EXPECT_FALSE(control.take(2, 1ms));
  EXPECT_TRUE(control.leaving());
  control.left();
  EXPECT_TRUE(control.take(2, 1ms));
}

TEST(WebControl, EndsWhenItsHolderIsSilent) {
  Control control;
  EXPECT_TRUE(control.take(1, 1000ms));
  EXPECT_FALSE(control.expired(1499ms));
  EXPECT_TRUE(control.expired(1500ms));
  EXPECT_TRUE(control.alive(1, 1400ms, 1450ms));
  EXPECT_FALSE(control.expired(1899ms));
  EXPECT_TRUE(control.expired(1900ms));
}

TEST(WebControl, EndsWhenTheMessagesOfItsHolderAreOld) {
  Control control;
  EXPECT_TRUE(control.take(1, 1000ms));
  EXPECT_TRUE(control.alive(1, 1100ms, 1110ms));
  // Old messages arrive repeatedly, as over a network that delays messages.
  for (auto now = 1110ms; now < 1600ms; now += 10ms) {
    EXPECT_FALSE(control.alive(1, 1100ms, now));
    EXPECT_FALSE(control.alive(1, 900ms, now));
  }
  EXPECT_TRUE(control.expired(1600ms));
}

TEST(WebControl, IgnoresAnAliveMessageFromTheFuture) {
  Control control;
  EXPECT_TRUE(control.take(1, 1000ms));
  EXPECT_FALSE(control.alive(1, 1101ms, 1100ms));
  EXPECT_FALSE(control.alive(1, -1ms, 1100ms));
  EXPECT_FALSE(control.alive(2, 1100ms, 1100ms));
  EXPECT_TRUE(control.expired(1500ms));
}

}  // namespace
}  // namespace r4::tool::web
