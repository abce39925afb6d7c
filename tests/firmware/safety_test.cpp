// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/safety.hpp"

#include <gtest/gtest.h>

namespace r4::firmware {
namespace {

constexpr SafeReason gravest_first[] = {SafeReason::stop,      SafeReason::fault,
                                        SafeReason::watchdog,  SafeReason::handle,
                                        SafeReason::proximity, SafeReason::link};

TEST(Safety, BeginsWithoutAHost) {
  const Safety safety;
  EXPECT_TRUE(safety.is_safe());
  EXPECT_EQ(safety.reason(), SafeReason::link);
}

TEST(Safety, StaysSafeWhileAnyCauseRemains) {
  Safety safety;
  EXPECT_FALSE(safety.enter(SafeReason::link));
  EXPECT_TRUE(safety.enter(SafeReason::handle));
  EXPECT_TRUE(safety.leave(SafeReason::link));
  EXPECT_FALSE(safety.leave(SafeReason::link));
  EXPECT_TRUE(safety.is_safe());
  EXPECT_FALSE(safety.has(SafeReason::link));
  EXPECT_TRUE(safety.has(SafeReason::handle));
  EXPECT_TRUE(safety.leave(SafeReason::handle));
  EXPECT_FALSE(safety.is_safe());
}

TEST(Safety, ReportsTheGravestOfAnyTwo) {
  for (std::size_t i = 0; i < std::size(gravest_first); ++i) {
    for (std::size_t j = i; j < std::size(gravest_first); ++j) {
      Safety safety;
      safety.enter(gravest_first[j]);
      safety.enter(gravest_first[i]);
      EXPECT_EQ(safety.reason(), gravest_first[i]);
    }
  }
}

TEST(Safety, ClearRemovesTheReportedCauseIfItIsLatched) {
  Safety safety;
  for (const SafeReason cause : gravest_first) safety.enter(cause);
  for (const SafeReason next : {SafeReason::fault, SafeReason::watchdog, SafeReason::handle}) {
    safety.clear();
    EXPECT_EQ(safety.reason(), next);
  }
  safety.clear();
  EXPECT_EQ(safety.reason(), SafeReason::handle);
  EXPECT_TRUE(safety.has(SafeReason::proximity));
  EXPECT_TRUE(safety.has(SafeReason::link));
}

TEST(Safety, ClearWithoutACauseDoesNothing) {
  Safety safety;
  safety.leave(SafeReason::link);
  safety.clear();
  EXPECT_FALSE(safety.is_safe());
}

}  // namespace
}  // namespace r4::firmware
