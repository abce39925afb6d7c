// SPDX-License-Identifier: GPL-3.0-or-later
#include "transports/serial/unread_marks.hpp"

#include <gtest/gtest.h>

namespace r4 {
namespace {

using std::chrono::milliseconds;

TEST(UnreadMarks, GiveTheWriteTimeOfTheOldestUnreadBytes) {
  UnreadMarks marks;
  const UnreadMarks::Time start{};
  EXPECT_FALSE(marks.any());
  for (int i = 0; i < 10; ++i) marks.wrote(100, start + milliseconds(10 * i));
  EXPECT_EQ(marks.oldest(), start);
  marks.unread_at_most(1000);
  EXPECT_EQ(marks.oldest(), start);
  marks.unread_at_most(301);
  EXPECT_EQ(marks.oldest(), start + milliseconds(60));
  marks.unread_at_most(300);
  EXPECT_EQ(marks.oldest(), start + milliseconds(70));
  marks.unread_at_most(0);
  EXPECT_FALSE(marks.any());
}

TEST(UnreadMarks, AreNeverNewerThanTheOldestUnreadBytes) {
  UnreadMarks marks;
  UnreadMarks::Time now{};
  for (int i = 0; i < 100'000; ++i) {
    marks.wrote(10, now);
    now += std::chrono::microseconds(100);
    // 500 bytes, written in the last 5 ms, are unread.
    marks.unread_at_most(500);
    ASSERT_TRUE(marks.any());
    if (i < 100) continue;
    ASSERT_GE(now - marks.oldest(), milliseconds(5));
    ASSERT_LE(now - marks.oldest(), milliseconds(8));
  }
}

TEST(UnreadMarks, BoundTheirMemoryWithoutLosingTheOldest) {
  UnreadMarks marks;
  const UnreadMarks::Time start{};
  for (int i = 0; i < 1000; ++i) marks.wrote(100, start + milliseconds(10 * i));
  EXPECT_EQ(marks.oldest(), start);
  marks.unread_at_most(100);
  EXPECT_TRUE(marks.any());
  marks.unread_at_most(0);
  EXPECT_FALSE(marks.any());
}

}  // namespace
}  // namespace r4
