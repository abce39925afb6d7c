// SPDX-License-Identifier: GPL-3.0-or-later
#include "transports/can/can_trouble.hpp"

#include <gtest/gtest.h>

namespace r4::test {
namespace {

using namespace std::chrono_literals;

const CanTrouble::Time trouble_start{std::chrono::hours{1}};

TEST(CanTrouble, ReportsFramesWithoutADatagramAsAnotherProtocol) {
  CanTrouble trouble;
  for (auto after = 0ms; after < 500ms; after += 10ms) {
    trouble.on_host_frame(trouble_start + after);
    EXPECT_EQ(trouble.now(trouble_start + after), TransportTrouble::none) << after.count();
    EXPECT_TRUE(trouble.hears_host(trouble_start + after)) << "the frames may come from a host";
  }
  trouble.on_host_frame(trouble_start + 500ms);
  EXPECT_EQ(trouble.now(trouble_start + 500ms), TransportTrouble::foreign_frames);
  EXPECT_FALSE(trouble.hears_host(trouble_start + 500ms));
  EXPECT_EQ(trouble.now(trouble_start + 1500ms), TransportTrouble::none) << "the frames have ended";
}

TEST(CanTrouble, AHostThatPausesOrEndsIsNotAnotherProtocol) {
  CanTrouble trouble;
  trouble.on_host_frame(trouble_start);
  trouble.on_host_datagram(trouble_start + 1ms);
  for (auto after = 1ms; after < 2s; after += 10ms) {
    EXPECT_EQ(trouble.now(trouble_start + after), TransportTrouble::none) << after.count();
  }
  trouble.on_host_frame(trouble_start + 900ms);  // the first frame of a heartbeat
  EXPECT_EQ(trouble.now(trouble_start + 900ms), TransportTrouble::none);
  EXPECT_TRUE(trouble.hears_host(trouble_start + 900ms));
}

TEST(CanTrouble, AHostIsNotAnotherProtocol) {
  CanTrouble trouble;
  for (auto after = 0ms; after < 5s; after += 100ms) {
    trouble.on_host_frame(trouble_start + after);
    trouble.on_host_datagram(trouble_start + after + 1ms);
    EXPECT_EQ(trouble.now(trouble_start + after + 99ms), TransportTrouble::none);
    EXPECT_TRUE(trouble.hears_host(trouble_start + after + 99ms));
  }
  EXPECT_FALSE(trouble.hears_host(trouble_start + 6s));
}

TEST(CanTrouble, ReportsLateFramesOnlyWhileTheBoardIsHeard) {
  CanTrouble trouble;
  trouble.on_late(2, trouble_start);
  trouble.on_board(trouble_start);
  EXPECT_EQ(trouble.now(trouble_start), TransportTrouble::none) << "two late frames may be chance";
  trouble.on_late(3, trouble_start + 1900ms);
  EXPECT_EQ(trouble.now(trouble_start + 1950ms), TransportTrouble::late_frames);
  EXPECT_EQ(trouble.now(trouble_start + 2100ms), TransportTrouble::none)
      << "the late frames were long ago";
  trouble.on_late(10, trouble_start + 4s);
  EXPECT_EQ(trouble.now(trouble_start + 4s), TransportTrouble::none) << "the board is not heard";
}

}  // namespace
}  // namespace r4::test
