// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/vocabulary.hpp"

#include <gtest/gtest.h>

namespace r4 {
namespace {

TEST(Units, EverySafeReasonHasAText) {
  EXPECT_STREQ(to_text(SafeReason::none), "none");
  EXPECT_STREQ(to_text(SafeReason::link), "link");
  EXPECT_STREQ(to_text(SafeReason::stop), "stop");
  EXPECT_STREQ(to_text(SafeReason::handle), "handle");
  EXPECT_STREQ(to_text(SafeReason::proximity), "proximity");
  EXPECT_STREQ(to_text(SafeReason::watchdog), "watchdog");
  EXPECT_STREQ(to_text(SafeReason::fault), "fault");
  EXPECT_STREQ(to_text(static_cast<SafeReason>(safe_reason_count)), "unknown");
  EXPECT_STREQ(to_text(static_cast<SafeReason>(255)), "unknown");
}

TEST(Units, DrivesAndBldcCompareByEveryMember) {
  const Drive drive{100, Direction::forward};
  EXPECT_EQ(drive, (Drive{100, Direction::forward}));
  EXPECT_NE(drive, (Drive{101, Direction::forward}));
  EXPECT_NE(drive, (Drive{100, Direction::reverse}));
  const Bldc bldc{100, Direction::forward, true};
  EXPECT_EQ(bldc, (Bldc{100, Direction::forward, true}));
  EXPECT_NE(bldc, (Bldc{101, Direction::forward, true}));
  EXPECT_NE(bldc, (Bldc{100, Direction::reverse, true}));
  EXPECT_NE(bldc, (Bldc{100, Direction::forward, false}));
}

}  // namespace
}  // namespace r4
