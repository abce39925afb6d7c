// SPDX-License-Identifier: GPL-3.0-or-later
// A host that says that it ends: what proves it, and what it ends.
#include "board_link_fixture.hpp"

namespace r4 {
namespace {

struct BoardLinkFarewell : BoardLinkTest {
  bool may_leave(std::uint64_t t, Source from = here) {
    return link.may_leave(numbered(echo_pnum + 20, t, from), now);
  }
};

TEST_F(BoardLinkFarewell, AHeartbeatThatItOvertookBeginsNothing) {
  connect();
  run(300);
  const std::uint32_t before = sent.back();
  run(100);
  link.leave(now);
  send_due();
  EXPECT_EQ(heartbeat(echo_pnum + 2, before), HeartbeatEffect::stale);
  EXPECT_EQ(link.state(), BoardLinkState::lost);
}

TEST_F(BoardLinkFarewell, AHeartbeatThatItOvertookBeginsNothingInItsMillisecondEither) {
  connect();
  run(300);
  link.heartbeat_answered(now);
  link.leave(now);
  send_due();
  EXPECT_EQ(heartbeat(echo_pnum + 2, now), HeartbeatEffect::stale);
  run(1);
  EXPECT_EQ(heartbeat(echo_pnum + 2, now - 1), HeartbeatEffect::stale);
  EXPECT_EQ(link.state(), BoardLinkState::lost);
  link.heartbeat_answered(now);
  EXPECT_EQ(heartbeat(echo_pnum + 3, now), HeartbeatEffect::new_session)
      << "another host may begin";
}

TEST_F(BoardLinkFarewell, EchoesAHeartbeatOfThisSession) {
  connect();
  run(300);
  const std::uint32_t first_session = sent.back();
  run(1500);
  ASSERT_EQ(link.state(), BoardLinkState::lost);
  ASSERT_EQ(heartbeat(echo_pnum + 70000, sent.back()), HeartbeatEffect::new_session);
  EXPECT_FALSE(may_leave(first_session)) << "of the session before";
  EXPECT_TRUE(may_leave(sent.back()));
  EXPECT_FALSE(may_leave(0));
  EXPECT_FALSE(may_leave(sent.back() + 1));
}

TEST_F(BoardLinkFarewell, OfASessionBeforeIsNotTakenHoweverSoonTheNextBegins) {
  connect();
  run(300);
  const std::uint32_t first_session = sent.back();
  link.leave(now);
  run(1);
  ASSERT_EQ(heartbeat(echo_pnum + 30, sent.back()), HeartbeatEffect::new_session);
  EXPECT_FALSE(may_leave(first_session));
}

TEST_F(BoardLinkFarewell, TooOldAnEchoProvesNothing) {
  connect();
  const std::uint32_t old = sent.back();
  for (std::uint32_t i = 2; i < 14; ++i) {
    run(100);
    heartbeat(echo_pnum + i, sent.back());
  }
  EXPECT_FALSE(may_leave(old));
}

TEST_F(BoardLinkFarewell, IsObeyedInASessionOfAnyAge) {
  constexpr std::uint32_t day_ms = 24U * 3600 * 1000;
  constexpr std::uint32_t step_ms = 9000;
  link.set_timing({500, step_ms + 1000});
  connect();
  std::uint32_t pnum = echo_pnum + 1;
  for (int day = 1; day <= 60; ++day) {  // more than a turn of the clock
    for (std::uint32_t ms = 0; ms < day_ms; ms += step_ms) {
      now += step_ms;
      link.poll(now);
      link.heartbeat_sent(now);
      ASSERT_EQ(link.on_heartbeat(numbered(++pnum, now, here), now), HeartbeatEffect::fed);
      if (ms % (24U * step_ms) == 0) {
        ASSERT_TRUE(link.may_leave(numbered(pnum + 1, now, here), now)) << "day " << day;
      }
    }
  }
}

}  // namespace
}  // namespace r4
