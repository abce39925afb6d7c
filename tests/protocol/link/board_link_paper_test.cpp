// SPDX-License-Identifier: GPL-3.0-or-later
// The board's end of the link with paper hosts, which have no SID.
#include "board_link_fixture.hpp"

namespace r4 {
namespace {

TEST_F(BoardLinkTest, APaperHostWithItsOwnClockKeepsTheLinkAlive) {
  EXPECT_EQ(heartbeat(0, 1699276044383, paper), HeartbeatEffect::new_session);
  EXPECT_EQ(command(1, paper), "execute");
  for (std::uint32_t i = 1; i < 5; ++i) {
    run(900);
    EXPECT_EQ(heartbeat(8 * i, 1699276044383, paper),
              HeartbeatEffect::fed);  // a clock may stop
  }
  run(1000);
  EXPECT_EQ(heartbeat(100, 1699276044390, paper), HeartbeatEffect::new_session);
}

TEST_F(BoardLinkTest, APaperHostsClockMayShowATimeOfTheBoard) {
  send_due();
  heartbeat(0, 4000, paper);
  const std::uint32_t ours = sent.back();
  run(900);
  EXPECT_EQ(heartbeat(1, 4001, paper), HeartbeatEffect::fed);
  run(900);
  EXPECT_EQ(heartbeat(2, ours, paper), HeartbeatEffect::fed);
}

TEST_F(BoardLinkTest, APaperHostThatEchoesMustKeepEchoing) {
  send_due();
  heartbeat(0, 0, paper);
  EXPECT_EQ(heartbeat(1, sent.back(), paper), HeartbeatEffect::fed);
  run(500);
  EXPECT_EQ(heartbeat(2, 4711, paper), HeartbeatEffect::stale);
  EXPECT_EQ(heartbeat(3, sent.back(), paper), HeartbeatEffect::fed);
  run(400);
  const std::uint32_t old_echo = sent.front();
  run(300);
  EXPECT_EQ(heartbeat(4, old_echo, paper), HeartbeatEffect::stale);
}

TEST_F(BoardLinkTest, AnEchoingPaperHostReconnectsOnlyWithANewEcho) {
  send_due();
  heartbeat(0, 0, paper);
  heartbeat(1, sent.back(), paper);
  run(999);
  const std::uint32_t before = sent.back();
  run(1);
  ASSERT_EQ(link.state(), BoardLinkState::lost);
  EXPECT_EQ(heartbeat(2, before, paper), HeartbeatEffect::unheard);
  EXPECT_EQ(heartbeat(3, sent.back(), paper), HeartbeatEffect::new_session);
}

TEST_F(BoardLinkTest, AHostWithAnotherClockIsAnotherHost) {
  // A host without packet numbers at the same peer, as on a serial line.
  send_due();
  numberless(0);
  numberless(sent.back());
  run(1000);
  ASSERT_EQ(link.state(), BoardLinkState::lost);
  EXPECT_EQ(numberless(1699276044383), HeartbeatEffect::new_session);
}

TEST_F(BoardLinkTest, APaperHostWithoutNumbersIsServed) {
  EXPECT_EQ(numberless(79201), HeartbeatEffect::new_session);
  EXPECT_EQ(command(66, paper), "execute");
  EXPECT_EQ(command(66, paper), "DUPLICATE");
  EXPECT_EQ(command(65, paper), "STALE");
  run(900);
  EXPECT_EQ(numberless(79701), HeartbeatEffect::fed);
}

// The board cannot distinguish this host from a host that restarted during the outage and counts
// from 0 again.
TEST_F(BoardLinkTest, APaperHostWithoutNumbersBeginsANewSessionAfterALoss) {
  numberless(79201);
  command(5000, paper);
  run(1000);
  EXPECT_EQ(numberless(80201), HeartbeatEffect::new_session);
  EXPECT_EQ(command(0, paper), "execute");
}

TEST_F(BoardLinkTest, HeartbeatsThatGainOrLoseNumbersAreAnotherHost) {
  numberless(5);
  EXPECT_EQ(heartbeat(1, 6, paper), HeartbeatEffect::stale);
  run(1000);
  EXPECT_EQ(heartbeat(2, 7, paper), HeartbeatEffect::new_session);
  EXPECT_EQ(numberless(8), HeartbeatEffect::stale);
  run(1000);
  EXPECT_EQ(numberless(9), HeartbeatEffect::new_session);
}

TEST_F(BoardLinkTest, ARestartedPaperHostIsANewSessionAfterTheTimeout) {
  heartbeat(1000, 4000, paper);
  command(1001, paper);
  EXPECT_EQ(heartbeat(0, 4001, paper), HeartbeatEffect::stale);
  EXPECT_EQ(command(1, paper), "STALE");
  run(1000);
  EXPECT_EQ(heartbeat(8, 4002, paper), HeartbeatEffect::new_session);
  EXPECT_EQ(command(7, paper), "STALE");
  EXPECT_EQ(command(9, paper), "execute");
}

}  // namespace
}  // namespace r4
