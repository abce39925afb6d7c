// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/application/state_schedule.hpp"

#include <gtest/gtest.h>

namespace r4::firmware {
namespace {

TEST(StateSchedule, IsDueAtOnceAndThenEachPeriod) {
  StateSchedule schedule;
  std::uint32_t t = 0;
  EXPECT_FALSE(schedule.running());
  EXPECT_FALSE(schedule.take(5, t));
  schedule.start(100, 10);
  EXPECT_TRUE(schedule.running());
  EXPECT_EQ(schedule.due_in(100), 0U);
  EXPECT_TRUE(schedule.take(100, t));
  EXPECT_EQ(t, 100U);
  EXPECT_FALSE(schedule.take(100, t));
  EXPECT_EQ(schedule.due_in(103), 7U);
  EXPECT_FALSE(schedule.take(109, t));
  EXPECT_TRUE(schedule.take(110, t));
  EXPECT_EQ(t, 110U);
}

TEST(StateSchedule, LatenessDoesNotAddUp) {
  StateSchedule schedule;
  schedule.start(0, 10);
  std::uint32_t t = 0;
  for (std::uint32_t i = 0; i < 1000; ++i) {
    EXPECT_TRUE(schedule.take(10 * i + i % 10, t));
    EXPECT_EQ(t, 10 * i);
  }
  EXPECT_EQ(schedule.late(), 0U);
}

TEST(StateSchedule, SkipsAndCountsWholePeriods) {
  StateSchedule schedule;
  schedule.start(0, 10);
  std::uint32_t t = 0;
  EXPECT_TRUE(schedule.take(9, t));
  EXPECT_EQ(t, 0U);
  EXPECT_TRUE(schedule.take(40, t));  // 10, 20 and 30 are past
  EXPECT_EQ(t, 40U);
  EXPECT_EQ(schedule.late(), 3U);
  EXPECT_TRUE(schedule.take(50, t));
  EXPECT_EQ(t, 50U);
  EXPECT_EQ(schedule.late(), 3U);
}

TEST(StateSchedule, ANewPeriodAppliesFromTheNextState) {
  StateSchedule schedule;
  schedule.start(0, 10);
  std::uint32_t t = 0;
  EXPECT_TRUE(schedule.take(0, t));
  schedule.set_period(1);
  EXPECT_FALSE(schedule.take(9, t));
  EXPECT_TRUE(schedule.take(10, t));
  EXPECT_TRUE(schedule.take(11, t));
  EXPECT_EQ(t, 11U);
}

TEST(StateSchedule, StopsAndBeginsANewGrid) {
  StateSchedule schedule;
  schedule.start(0, 10);
  schedule.stop();
  std::uint32_t t = 0;
  EXPECT_FALSE(schedule.take(1000, t));
  schedule.start(1003, 10);
  EXPECT_TRUE(schedule.take(1004, t));
  EXPECT_EQ(t, 1003U);
  EXPECT_EQ(schedule.late(), 0U);
}

TEST(StateSchedule, ContinuesWhenTheClockWraps) {
  StateSchedule schedule;
  schedule.start(0xfffffff8U, 10);
  std::uint32_t t = 0;
  EXPECT_TRUE(schedule.take(0xfffffff8U, t));
  EXPECT_EQ(schedule.due_in(0xffffffffU), 3U);
  EXPECT_FALSE(schedule.take(1, t));
  EXPECT_TRUE(schedule.take(2, t));
  EXPECT_EQ(t, 2U);
}

}  // namespace
}  // namespace r4::firmware
