// SPDX-License-Identifier: GPL-3.0-or-later
#include "protocol/link/host_link.hpp"

#include <gtest/gtest.h>

#include "protocol/link/board_link.hpp"

namespace r4 {
namespace {

constexpr std::uint32_t first_pnum = 4'294'967'000U;

struct HostLinkTest : testing::Test {
  void state(SafeReason reason = SafeReason::none) { link.on_reason(reason, now); }
  void heartbeat(SafeReason reason = SafeReason::none) {
    link.on_heartbeat(board_t());
    link.on_reason(reason, now);
  }
  void booting(SafeReason reason = SafeReason::none) { link.on_booting(reason, now); }
  // If a heartbeat is due, sends the heartbeat and returns true.
  bool send_due() {
    if (!link.heartbeat_due(now)) return false;
    link.heartbeat_sent(now);
    return true;
  }
  std::uint32_t board_t() const { return now + board_offset; }

  HostLink link{LinkTiming{}, first_pnum};
  std::uint32_t now = 5000;
  std::uint32_t board_offset = 123'456;
};

TEST_F(HostLinkTest, StartsConnectingAndSendsTheFirstHeartbeat) {
  EXPECT_EQ(link.state(), HostLinkState::connecting);
  EXPECT_EQ(link.due_in(now), 0U);
  EXPECT_TRUE(send_due());
  EXPECT_EQ(link.echo(), 0U);
  EXPECT_FALSE(link.echoed());
  EXPECT_FALSE(send_due());
}

TEST_F(HostLinkTest, TriesAgainSoonWhenAHeartbeatCouldNotBeSent) {
  heartbeat();
  ASSERT_TRUE(link.heartbeat_due(now));
  link.heartbeat_not_sent(now);
  EXPECT_FALSE(link.echoed()) << "the board has not received its time yet";
  EXPECT_FALSE(link.heartbeat_due(now));
  EXPECT_EQ(link.due_in(now), HostLink::retry_ms);
  now += HostLink::retry_ms;
  EXPECT_TRUE(send_due());
  EXPECT_TRUE(link.echoed());
  EXPECT_EQ(link.due_in(now), 100U);
}

TEST_F(HostLinkTest, AnswersABoardHeartbeatAtOnceWithItsTime) {
  send_due();
  now += 30;
  heartbeat();
  EXPECT_EQ(link.due_in(now), 0U);
  EXPECT_EQ(link.echo(), board_t());
  EXPECT_FALSE(link.echoed());
  EXPECT_TRUE(send_due());
  EXPECT_TRUE(link.echoed());
  EXPECT_EQ(link.due_in(now), 100U);
}

// A board that cannot use the answer sends the same T again. Board and host must not answer each
// other for ever.
TEST_F(HostLinkTest, AnswersEachBoardTimeAtOnceOnlyOnce) {
  heartbeat();
  ASSERT_TRUE(send_due());
  heartbeat();
  EXPECT_FALSE(link.heartbeat_due(now)) << "the same T";
  ++now;
  heartbeat();
  EXPECT_TRUE(send_due());
}

TEST_F(HostLinkTest, AStateIsNotEchoed) {
  heartbeat();
  const std::uint32_t t = link.echo();
  send_due();
  now += 10;
  state();
  EXPECT_EQ(link.echo(), t);
  EXPECT_FALSE(link.heartbeat_due(now));
}

TEST_F(HostLinkTest, FollowsTheBoardsState) {
  state();
  EXPECT_EQ(link.state(), HostLinkState::active);
  EXPECT_EQ(link.reason(), SafeReason::none);
  heartbeat(SafeReason::handle);
  EXPECT_EQ(link.state(), HostLinkState::safe);
  EXPECT_EQ(link.reason(), SafeReason::handle);
  state(SafeReason::stop);
  EXPECT_EQ(link.reason(), SafeReason::stop);
  state();
  EXPECT_EQ(link.state(), HostLinkState::active);
}

TEST_F(HostLinkTest, LosesASilentBoardExactlyAtTheTimeout) {
  state();
  now += 999;
  EXPECT_FALSE(link.poll(now));
  now += 1;
  EXPECT_TRUE(link.poll(now));
  EXPECT_EQ(link.state(), HostLinkState::lost);
  EXPECT_FALSE(link.poll(now));
  state();
  EXPECT_EQ(link.state(), HostLinkState::active);
}

TEST_F(HostLinkTest, AnAnswerKeepsTheLinkAliveAndTheStateUnchanged) {
  state(SafeReason::stop);
  now += 900;
  link.on_heard(now);
  now += 900;
  EXPECT_FALSE(link.poll(now));
  EXPECT_EQ(link.state(), HostLinkState::safe);
}

TEST_F(HostLinkTest, DoesNotLoseABoardThatItHasNotFound) {
  now += 100'000;
  EXPECT_FALSE(link.poll(now));
  EXPECT_EQ(link.state(), HostLinkState::connecting);
}

TEST_F(HostLinkTest, ABootingBoardReturnsTheLinkToConnecting) {
  heartbeat();
  send_due();
  EXPECT_TRUE(link.echoed());
  booting(SafeReason::handle);
  EXPECT_EQ(link.state(), HostLinkState::connecting);
  EXPECT_EQ(link.reason(), SafeReason::handle);
  EXPECT_EQ(link.echo(), 0U);
  EXPECT_FALSE(link.echoed());
  EXPECT_TRUE(link.heartbeat_due(now));
}

TEST_F(HostLinkTest, NeedsANewSessionIfOnlyTheClockShowsARestart) {
  ASSERT_TRUE(link.wants_session());
  link.begin_session(7);
  heartbeat();
  const std::uint32_t before = link.take_pnum();
  link.on_restart();  // or the clock of the host stopped
  ASSERT_EQ(link.restarts(), 1U);
  EXPECT_EQ(link.echo(), 0U);
  ASSERT_TRUE(link.wants_session());
  link.begin_session(8);
  EXPECT_FALSE(link.is_taken(before));
  EXPECT_EQ(link.take_pnum(), before + 1);
  EXPECT_TRUE(link.is_taken(before + 1));
  booting();
  link.on_restart();
  ASSERT_EQ(link.restarts(), 2U);
  EXPECT_FALSE(link.wants_session()) << "the board reported its restart";
}

TEST_F(HostLinkTest, StartsAgainAfterTheComputerSlept) {
  heartbeat();
  send_due();
  const std::uint32_t before = link.take_pnum();
  ASSERT_TRUE(link.echoed());
  link.begin_anew();
  EXPECT_EQ(link.restarts(), 1U);
  EXPECT_EQ(link.state(), HostLinkState::lost);
  EXPECT_FALSE(link.echoed());
  EXPECT_EQ(link.echo(), 0U);
  EXPECT_TRUE(link.wants_session());
  EXPECT_FALSE(link.is_taken(before));
  EXPECT_TRUE(link.heartbeat_due(now));
}

TEST_F(HostLinkTest, ReportsThatTheBoardHasBeenSilentForDays) {
  EXPECT_FALSE(link.long_silent(now)) << "nothing was heard yet";
  heartbeat();
  now += 12U * 24 * 3600 * 1000;
  EXPECT_FALSE(link.long_silent(now));
  now += 24U * 3600 * 1000;
  EXPECT_TRUE(link.long_silent(now));
  link.begin_anew();
  EXPECT_FALSE(link.long_silent(now));
}

TEST_F(HostLinkTest, LosesTheLinkAtOnceWhenTheTransportFails) {
  link.on_transport(false);
  EXPECT_EQ(link.state(), HostLinkState::connecting);
  state();
  send_due();
  link.on_transport(false);
  EXPECT_EQ(link.state(), HostLinkState::lost);
  EXPECT_FALSE(link.heartbeat_due(now));
  link.on_transport(true);
  EXPECT_TRUE(link.heartbeat_due(now));
}

TEST_F(HostLinkTest, TheWatchdogStopsTheHeartbeatsOfAHungApplication) {
  link.watchdog(200, now);
  send_due();
  for (int ms = 0; ms < 200; ++ms, ++now) send_due();
  EXPECT_FALSE(link.watchdog_expired(now));
  ++now;
  EXPECT_TRUE(link.watchdog_expired(now));
  for (int ms = 0; ms < 500; ++ms, ++now) EXPECT_FALSE(send_due());
  heartbeat();
  EXPECT_FALSE(send_due());  // also no answer
  EXPECT_GT(link.due_in(now), 0U);
  link.feed(now);
  EXPECT_TRUE(send_due());
}

TEST_F(HostLinkTest, TheWatchdogStaysExpiredWhenTheClockWraps) {
  link.watchdog(200, now);
  const std::uint32_t fed = now;
  for (; now - fed < 0xffff'0000U; now += 0x8000) link.poll(now);
  for (; now != fed; now += 0x1000) link.poll(now);
  now += 100;
  EXPECT_TRUE(link.watchdog_expired(now));
  EXPECT_FALSE(link.heartbeat_due(now));
  link.feed(now);
  EXPECT_TRUE(link.heartbeat_due(now));
}

TEST_F(HostLinkTest, TheWatchdogCanBeTurnedOff) {
  link.watchdog(200, now);
  now += 1000;
  EXPECT_FALSE(link.heartbeat_due(now));
  link.watchdog(0, now);
  EXPECT_TRUE(link.heartbeat_due(now));
}

TEST_F(HostLinkTest, NumbersEveryDatagramItSends) {
  EXPECT_EQ(link.take_pnum(), first_pnum);
  EXPECT_EQ(link.take_pnum(), first_pnum + 1);
  EXPECT_EQ(link.last_pnum(), first_pnum + 1);
}

TEST_F(HostLinkTest, ReportsExactlyWhenItIsDue) {
  state();
  send_due();
  EXPECT_EQ(link.due_in(now), 100U);
  now += 60;
  EXPECT_EQ(link.due_in(now), 40U);
  now += 40;
  EXPECT_EQ(link.due_in(now), 0U);
  now += 850;
  send_due();
  EXPECT_EQ(link.due_in(now), 50U);  // until the link is lost
  now += 50;
  EXPECT_TRUE(link.poll(now));
}

TEST(HostLinkState, HasANameForEveryState) {
  EXPECT_STREQ(to_text(HostLinkState::connecting), "connecting");
  EXPECT_STREQ(to_text(HostLinkState::active), "active");
  EXPECT_STREQ(to_text(HostLinkState::safe), "safe");
  EXPECT_STREQ(to_text(HostLinkState::lost), "lost");
}

}  // namespace
}  // namespace r4
