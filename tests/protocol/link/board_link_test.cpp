// SPDX-License-Identifier: GPL-3.0-or-later
// The board's end of the link in virtual time: whose heartbeat feeds, and which command may pass.
#include "board_link_fixture.hpp"

namespace r4 {
namespace {

// --- sessions

TEST_F(BoardLinkTest, BeginsConnecting) {
  EXPECT_EQ(link.state(), BoardLinkState::connecting);
  EXPECT_FALSE(link.has_owner());
  EXPECT_FALSE(link.in_session(Source{}));
  EXPECT_EQ(link.last_executed(), 0U);
  EXPECT_EQ(command(1), "SAFE");
}

TEST_F(BoardLinkTest, TheFirstHostBecomesTheOwner) {
  connect();
  EXPECT_EQ(link.state(), BoardLinkState::active);
  EXPECT_TRUE(link.has_owner());
  EXPECT_TRUE(link.owner() == here);
  EXPECT_TRUE(link.in_session(here));
  EXPECT_FALSE(link.in_session(there));
  EXPECT_EQ(heartbeat(echo_pnum + 50, sent.back(), there), HeartbeatEffect::busy);
  EXPECT_EQ(command(echo_pnum + 50, there), "BUSY");
}

TEST_F(BoardLinkTest, AnEchoOfAnotherBootBeginsNothing) {
  EXPECT_EQ(heartbeat(echo_pnum, 123), HeartbeatEffect::stale);
  EXPECT_EQ(link.state(), BoardLinkState::connecting);
}

TEST_F(BoardLinkTest, LosesASilentOwnerExactlyAtTheTimeout) {
  connect();
  const std::uint32_t fed = now;
  run(2000);
  EXPECT_EQ(lost_at - fed, 1000U);
  EXPECT_EQ(link.state(), BoardLinkState::lost);
  EXPECT_FALSE(link.has_owner());
  EXPECT_TRUE(link.in_session(here));
  EXPECT_EQ(link.fed_ms(), fed);
}

TEST_F(BoardLinkTest, ReportsTheLossOnce) {
  connect();
  now += 1000;
  EXPECT_TRUE(link.poll(now));
  EXPECT_FALSE(link.poll(now));
  EXPECT_FALSE(link.poll(now + 5000));
}

TEST_F(BoardLinkTest, LosesTheOwnerWithItsPortOnly) {
  connect();
  EXPECT_FALSE(link.port_lost(1, now));
  EXPECT_TRUE(link.port_lost(0, now));
  EXPECT_EQ(link.state(), BoardLinkState::lost);
  EXPECT_FALSE(link.port_lost(0, now));
}

TEST_F(BoardLinkTest, TheSameHostResumesWithAnEchoFromAfterTheLoss) {
  connect();
  run(900);
  const std::uint32_t before = sent.back();
  run(100);
  ASSERT_EQ(link.state(), BoardLinkState::lost);
  EXPECT_GE(sent.back(), lost_at);
  EXPECT_EQ(heartbeat(echo_pnum + 2, before), HeartbeatEffect::stale);
  EXPECT_EQ(heartbeat(echo_pnum + 4, sent.back()), HeartbeatEffect::resumed);
}

TEST_F(BoardLinkTest, AHostIsServedAfterWeeksOfSilence) {
  connect();
  now += 2000;
  ASSERT_TRUE(link.poll(now));
  for (int day = 0; day < 30; ++day) {  // more than half a turn of the clock
    now += 24U * 3600 * 1000;
    send_due();
  }
  now += 5;
  ASSERT_EQ(heartbeat(echo_pnum + 2, sent.back()), HeartbeatEffect::resumed);
  EXPECT_TRUE(link.heartbeat_due(now + BoardLink::echo_retry_ms)) << "its echo is missed again";
}

TEST_F(BoardLinkTest, OtherNumbersOrAnotherPlaceAreANewSession) {
  for (const Source from : {here, there}) {
    link = BoardLink(BoardLink::Timing{});
    sent.clear();
    connect();
    run(1000);
    EXPECT_EQ(heartbeat(echo_pnum + 100'000'000, sent.back(), from), HeartbeatEffect::new_session);
    EXPECT_EQ(command(echo_pnum + 100'000'001, from), "execute");  // its echo has armed it
  }
}

TEST_F(BoardLinkTest, AfterAnOutageNumbersGoOnWithinANarrowWindow) {
  for (const bool too_far : {false, true}) {
    link = BoardLink(BoardLink::Timing{});
    sent.clear();
    connect();
    run(1000);
    const std::uint32_t ahead = BoardLink::resume_window + (too_far ? 1 : 0);
    EXPECT_EQ(heartbeat(echo_pnum + 1 + ahead, sent.back()),
              too_far ? HeartbeatEffect::new_session : HeartbeatEffect::resumed);
  }
}

TEST_F(BoardLinkTest, WhileActiveNumbersMayJumpWithinTheWideWindow) {
  connect();
  run(100);
  std::uint32_t pnum = echo_pnum + 1 + BoardLink::command_window;
  EXPECT_EQ(heartbeat(pnum, sent.back()), HeartbeatEffect::fed);
  pnum += BoardLink::command_window + 1;
  EXPECT_EQ(heartbeat(pnum, sent.back()), HeartbeatEffect::stale);
}

TEST_F(BoardLinkTest, AHostThatHasNothingToEchoAnyMoreHasBegunAgain) {
  // Its first number happens to fit the session before.
  for (const std::uint32_t silence : {1010U, 1500U}) {
    link = BoardLink(BoardLink::Timing{});
    sent.clear();
    connect();
    command(echo_pnum + 2);
    run(silence);
    EXPECT_EQ(heartbeat(echo_pnum + 500, 0), HeartbeatEffect::stale);
    run(5);
    link.heartbeat_answered(now);
    EXPECT_EQ(heartbeat(echo_pnum + 501, now), HeartbeatEffect::new_session) << silence;
    EXPECT_EQ(command(echo_pnum + 502), "execute");
  }
}

TEST_F(BoardLinkTest, ANewSessionWhoseNumbersGoOnDoesNotMoveTheGateBack) {
  connect();
  command(echo_pnum + 5);
  run(1010);
  heartbeat(echo_pnum + 2, 0);
  link.heartbeat_answered(now);
  // The newest heartbeat, but older than the command.
  EXPECT_EQ(heartbeat(echo_pnum + 3, now), HeartbeatEffect::new_session);
  EXPECT_EQ(command(echo_pnum + 4), "STALE");
  EXPECT_EQ(command(echo_pnum + 5), "DUPLICATE");
  EXPECT_EQ(command(echo_pnum + 6), "execute");
}

TEST_F(BoardLinkTest, ANewSessionKeepsItsKindBehindTheWrap) {
  send_due();
  heartbeat(0xffffffffU, 0);
  heartbeat(0, sent.back());
  run(1010);
  heartbeat(1, 0);  // it has begun again, it seems
  link.heartbeat_answered(now);
  EXPECT_EQ(heartbeat(2, now), HeartbeatEffect::new_session);
  run(100);
  EXPECT_EQ(heartbeat(3, 4711), HeartbeatEffect::stale);
}

TEST_F(BoardLinkTest, AnOldHeartbeatWithNothingToEchoIsNoNews) {
  connect();
  run(100);
  heartbeat(echo_pnum + 3, sent.back());
  EXPECT_EQ(heartbeat(echo_pnum + 2, 0), HeartbeatEffect::stale);  // late, from the beginning
  EXPECT_EQ(heartbeat(echo_pnum, 0), HeartbeatEffect::stale);
  EXPECT_EQ(heartbeat(echo_pnum + 4, sent.back()), HeartbeatEffect::fed);
}

TEST_F(BoardLinkTest, AnUnarmedSessionIsNeverResumed) {
  send_due();
  heartbeat(echo_pnum, 0);
  run(1000);
  ASSERT_EQ(link.state(), BoardLinkState::lost);
  EXPECT_EQ(heartbeat(echo_pnum + 1, sent.back()), HeartbeatEffect::new_session);
}

TEST_F(BoardLinkTest, ARestartNeedsAnEchoNewerThanAnyOfTheSession) {
  connect();
  run(100);
  const std::uint32_t used = sent.front();
  const std::uint32_t newest = sent.back();
  heartbeat(echo_pnum + 2, newest);
  EXPECT_EQ(heartbeat(echo_pnum + 100'000'000, 0), HeartbeatEffect::stale);
  EXPECT_EQ(heartbeat(echo_pnum + 100'000'001, used), HeartbeatEffect::stale);
  EXPECT_EQ(heartbeat(echo_pnum + 100'000'002, newest), HeartbeatEffect::stale);
  run(1010);
  ASSERT_GT(sent.back(), newest);
  EXPECT_EQ(heartbeat(echo_pnum + 100'000'003, sent.back()), HeartbeatEffect::new_session);
  // What the host sent before its restart is of no effect now.
  EXPECT_EQ(heartbeat(echo_pnum + 3, newest), HeartbeatEffect::stale);
  EXPECT_EQ(command(echo_pnum + 4), "STALE");
}

TEST_F(BoardLinkTest, AnotherHostAtTheSamePlaceIsBusyWhileTheOwnerIsHeard) {
  connect();
  std::uint32_t owner = echo_pnum + 2;
  std::uint32_t other = echo_pnum + 100'000'000;
  for (int i = 0; i < 50; ++i) {
    EXPECT_EQ(heartbeat(owner++, sent.back()), HeartbeatEffect::fed);
    run(100);
    const HeartbeatEffect effect = heartbeat(other++, sent.back());
    EXPECT_TRUE(effect == HeartbeatEffect::busy || effect == HeartbeatEffect::stale);
    EXPECT_EQ(command(other++), "STALE");
  }
  EXPECT_EQ(command(owner), "execute");
  run(1010);
  EXPECT_EQ(heartbeat(other, sent.back()), HeartbeatEffect::new_session);
}

TEST_F(BoardLinkTest, ALateHeartbeatOfTheSessionIsNoRestart) {
  connect();
  run(500);
  heartbeat(echo_pnum + 200, sent[sent.size() - 2]);
  EXPECT_EQ(heartbeat(echo_pnum + 100, sent.back()), HeartbeatEffect::stale);
  EXPECT_EQ(heartbeat(echo_pnum + 200, sent.back()), HeartbeatEffect::stale);
}

// --- freshness of echo hosts

TEST_F(BoardLinkTest, OnlyAFreshEchoFeedsAnEchoHost) {
  connect();
  const std::uint32_t echoed = sent.back();
  run(999);
  EXPECT_EQ(heartbeat(echo_pnum + 2, echoed + 1), HeartbeatEffect::stale);  // no T of ours
  EXPECT_EQ(heartbeat(echo_pnum + 3, now + 5), HeartbeatEffect::stale);     // of the future
  EXPECT_EQ(heartbeat(echo_pnum + 4, 0), HeartbeatEffect::stale);
  EXPECT_EQ(heartbeat(echo_pnum + 5, (std::uint64_t{1} << 32) + sent.back()),
            HeartbeatEffect::stale);
  EXPECT_EQ(link.state(), BoardLinkState::active);
  run(1);
  EXPECT_EQ(link.state(), BoardLinkState::lost);
}

TEST_F(BoardLinkTest, AnEchoIsFreshUpToTheTimeout) {
  connect();
  const std::uint32_t echoed = sent.back();
  run(500);
  EXPECT_EQ(heartbeat(echo_pnum + 2, echoed), HeartbeatEffect::fed);
  run(500);
  EXPECT_EQ(heartbeat(echo_pnum + 3, echoed), HeartbeatEffect::fed);
  run(1);
  EXPECT_EQ(heartbeat(echo_pnum + 4, echoed), HeartbeatEffect::stale);
}

TEST_F(BoardLinkTest, ARepeatedOrOvertakenHeartbeatDoesNotFeed) {
  connect();
  run(400);
  EXPECT_EQ(heartbeat(echo_pnum + 3, sent.back()), HeartbeatEffect::fed);
  EXPECT_EQ(heartbeat(echo_pnum + 3, sent.back()), HeartbeatEffect::stale);
  EXPECT_EQ(heartbeat(echo_pnum + 2, sent.back()), HeartbeatEffect::stale);
}

TEST_F(BoardLinkTest, TheKindOfASessionOutlastsTheWrapOfItsNumbers) {
  send_due();
  std::uint32_t pnum = 0xffffff00U;
  heartbeat(pnum, 0);
  heartbeat(++pnum, sent.back());
  for (int i = 0; i < 20; ++i) {
    pnum += 4'000;
    run(100);
    ASSERT_EQ(heartbeat(pnum, sent.back()), HeartbeatEffect::fed) << pnum;
  }
  ASSERT_LT(pnum, echo_host_first_pnum);
  EXPECT_EQ(heartbeat(pnum + 2, sent.back() + 1), HeartbeatEffect::stale);  // still an echo host
  run(1000);
  ASSERT_EQ(link.state(), BoardLinkState::lost);
  EXPECT_EQ(heartbeat(pnum + 3, sent.back()), HeartbeatEffect::resumed);
}

// --- heartbeats that may have waited

TEST_F(BoardLinkTest, AHeartbeatFeedsFromWhenItMayHaveCome) {
  connect();
  run(900);
  const std::uint32_t read = now;
  ASSERT_EQ(late(300, echo_pnum + 2, sent[sent.size() - 4]), HeartbeatEffect::fed);
  EXPECT_EQ(link.fed_ms(), read - 300);
  EXPECT_EQ(link.deadline_ms(), read + 700);
  run(1000);
  EXPECT_EQ(lost_at, read + 700);
}

TEST_F(BoardLinkTest, AnEchoCameAfterWhatItEchoes) {
  connect();
  run(900);
  ASSERT_LT(now - sent.back(), 300U);
  ASSERT_EQ(late(300, echo_pnum + 2, sent.back()), HeartbeatEffect::fed);
  EXPECT_EQ(link.fed_ms(), sent.back());
}

TEST_F(BoardLinkTest, AHeartbeatThatWaitedMakesNothingOlder) {
  connect();
  run(100);
  const std::uint32_t fed = link.fed_ms();
  ASSERT_EQ(late(500, echo_pnum + 2, sent.front()), HeartbeatEffect::fed);
  EXPECT_EQ(link.fed_ms(), fed);
}

TEST_F(BoardLinkTest, AHeartbeatThatMayHaveWaitedForTheTimeoutDoesNothing) {
  EXPECT_EQ(late(1000, 1, 5), HeartbeatEffect::stale);
  EXPECT_EQ(link.state(), BoardLinkState::connecting);
  ASSERT_EQ(late(999, 1, 5), HeartbeatEffect::new_session);
  EXPECT_EQ(link.deadline_ms(), now + 1);
  run(500);
  ASSERT_EQ(link.state(), BoardLinkState::lost);
  EXPECT_EQ(late(1000, 2, 6), HeartbeatEffect::stale);
  EXPECT_EQ(late(1000, 7, 6, there), HeartbeatEffect::stale);
  EXPECT_EQ(link.state(), BoardLinkState::lost);
  ASSERT_EQ(late(400, 2, 6), HeartbeatEffect::resumed);
  EXPECT_EQ(link.deadline_ms(), now + 600);
}

TEST_F(BoardLinkTest, ACommandIsNoYoungerForAHeartbeatThatWaited) {
  heartbeat(1, 5);
  run(400);
  late(251, 10, 6);
  EXPECT_EQ(command(9), "STALE");
  EXPECT_EQ(command(11), "execute");
  run(400);
  late(250, 20, 7);
  EXPECT_EQ(command(19), "execute");
}

// --- paper hosts

TEST_F(BoardLinkTest, APaperHostWithAClockOfItsOwnFeedsByArriving) {
  EXPECT_EQ(heartbeat(0, 1699276044383), HeartbeatEffect::new_session);
  EXPECT_EQ(command(1), "execute");
  for (std::uint32_t i = 1; i < 5; ++i) {
    run(900);
    EXPECT_EQ(heartbeat(8 * i, 1699276044383), HeartbeatEffect::fed);  // a clock may stand still
  }
  run(1000);
  EXPECT_EQ(heartbeat(100, 1699276044390), HeartbeatEffect::resumed);
}

TEST_F(BoardLinkTest, AClockOfItsOwnMayHappenToShowATimeOfOurs) {
  send_due();
  heartbeat(0, 4000);
  const std::uint32_t ours = sent.back();
  run(900);
  EXPECT_EQ(heartbeat(1, 4001), HeartbeatEffect::fed);
  run(900);
  EXPECT_EQ(heartbeat(2, ours), HeartbeatEffect::fed);
}

TEST_F(BoardLinkTest, APaperHostThatEchoesMustGoOnEchoing) {
  send_due();
  heartbeat(0, 0);
  EXPECT_EQ(heartbeat(1, sent.back()), HeartbeatEffect::fed);
  run(500);
  EXPECT_EQ(heartbeat(2, 4711), HeartbeatEffect::stale);
  EXPECT_EQ(heartbeat(3, sent.back()), HeartbeatEffect::fed);
  run(400);
  const std::uint32_t old_echo = sent.front();
  run(300);
  EXPECT_EQ(heartbeat(4, old_echo), HeartbeatEffect::stale);
}

TEST_F(BoardLinkTest, APaperHostThatEchoesResumesWithAnEchoFromAfterTheLoss) {
  send_due();
  heartbeat(0, 0);
  heartbeat(1, sent.back());
  run(999);
  const std::uint32_t before = sent.back();
  run(1);
  ASSERT_EQ(link.state(), BoardLinkState::lost);
  EXPECT_EQ(heartbeat(2, before), HeartbeatEffect::stale);
  EXPECT_EQ(heartbeat(3, sent.back()), HeartbeatEffect::resumed);
}

TEST_F(BoardLinkTest, AHostWithAnotherClockIsAnotherHost) {
  // The same place and no numbers, as on a serial line.
  send_due();
  numberless(0);
  numberless(sent.back());
  run(1000);
  ASSERT_EQ(link.state(), BoardLinkState::lost);
  EXPECT_EQ(numberless(1699276044383), HeartbeatEffect::new_session);
}

TEST_F(BoardLinkTest, AHostWithoutNumbersIsServed) {
  EXPECT_EQ(numberless(79201), HeartbeatEffect::new_session);
  EXPECT_EQ(command(66), "execute");
  EXPECT_EQ(command(66), "DUPLICATE");
  EXPECT_EQ(command(65), "STALE");
  run(900);
  EXPECT_EQ(numberless(79701), HeartbeatEffect::fed);
  run(1000);
  EXPECT_EQ(numberless(80201), HeartbeatEffect::resumed);
  EXPECT_EQ(command(66), "DUPLICATE");
  EXPECT_EQ(command(67), "execute");
}

TEST_F(BoardLinkTest, AHostWithoutNumbersMayBeginAgainAfterALossOnly) {
  numberless(79201);
  EXPECT_EQ(command(5000), "execute");
  EXPECT_EQ(command(0), "STALE");
  run(1000);
  EXPECT_EQ(numberless(80201), HeartbeatEffect::resumed);
  EXPECT_EQ(command(4937), "STALE");  // may be a late one of before
  EXPECT_TRUE(link.begins_anew(0));
  EXPECT_FALSE(link.begins_anew(5001));
  EXPECT_EQ(command(0), "execute");
  EXPECT_FALSE(link.begins_anew(4000));
  EXPECT_EQ(command(0), "DUPLICATE");
  EXPECT_EQ(command(1), "execute");
}

TEST_F(BoardLinkTest, NumbersThatComeOrGoAreAnotherHost) {
  numberless(5);
  EXPECT_EQ(heartbeat(1, 6), HeartbeatEffect::stale);
  run(1000);
  EXPECT_EQ(heartbeat(2, 7), HeartbeatEffect::new_session);
  EXPECT_EQ(numberless(8), HeartbeatEffect::stale);
  run(1000);
  EXPECT_EQ(numberless(9), HeartbeatEffect::new_session);
}

TEST_F(BoardLinkTest, AnEchoHostTakesAPaperHostsPlaceAsANewSession) {
  numberless(5);
  command(7);
  EXPECT_EQ(heartbeat(echo_pnum, 0), HeartbeatEffect::stale);
  run(1);
  link.heartbeat_answered(now);
  EXPECT_EQ(heartbeat(echo_pnum + 1, now), HeartbeatEffect::busy);
  run(1000);
  EXPECT_EQ(heartbeat(echo_pnum + 2, sent.back()), HeartbeatEffect::new_session);
}

TEST_F(BoardLinkTest, APaperHostMayCountIntoTheUpperHalf) {
  std::uint32_t pnum = echo_host_first_pnum - 3;
  heartbeat(pnum, 4000);
  for (std::uint32_t i = 0; i < 6; ++i) {
    run(500);
    EXPECT_EQ(heartbeat(++pnum, 4000 + i), HeartbeatEffect::fed) << pnum;
  }
  run(1000);
  EXPECT_EQ(heartbeat(++pnum, 5000), HeartbeatEffect::resumed);
}

TEST_F(BoardLinkTest, ARestartedPaperHostIsANewSessionAfterTheTimeout) {
  heartbeat(1000, 4000);
  command(1001);
  EXPECT_EQ(heartbeat(0, 4001), HeartbeatEffect::stale);
  EXPECT_EQ(command(1), "STALE");
  run(1000);
  EXPECT_EQ(heartbeat(8, 4002), HeartbeatEffect::new_session);
  EXPECT_EQ(command(7), "STALE");
  EXPECT_EQ(command(9), "execute");
}

// --- commands

TEST_F(BoardLinkTest, ASessionIsArmedByItsFirstEcho) {
  send_due();
  heartbeat(echo_pnum, 0);
  EXPECT_EQ(command(echo_pnum + 1), "drop");
  EXPECT_EQ(heartbeat(echo_pnum + 2, sent.back()), HeartbeatEffect::fed);
  EXPECT_EQ(command(echo_pnum + 1), "STALE");  // from before
  EXPECT_EQ(command(echo_pnum + 3), "execute");
  EXPECT_EQ(link.last_executed(), echo_pnum + 3);
}

TEST_F(BoardLinkTest, ExecutesOnceAndNeverAnOlderOne) {
  connect();
  EXPECT_EQ(command(echo_pnum + 5), "execute");
  EXPECT_EQ(command(echo_pnum + 5), "DUPLICATE");
  EXPECT_EQ(command(echo_pnum + 4), "STALE");
  EXPECT_EQ(command(echo_pnum + 6), "execute");
  EXPECT_EQ(command(echo_pnum + 5), "DUPLICATE");
}

TEST_F(BoardLinkTest, TheWindowIs65536Ahead) {
  connect();
  command(echo_pnum + 2);
  EXPECT_EQ(command(echo_pnum + 2 + 65537), "STALE");
  EXPECT_EQ(command(echo_pnum + 2 + 65536), "execute");
}

TEST_F(BoardLinkTest, RemembersExactly64Numbers) {
  connect();
  const std::uint32_t base = echo_pnum + 2;
  for (std::uint32_t i = 0; i < 64; i += 2) EXPECT_EQ(command(base + i), "execute");
  for (std::uint32_t i = 0; i < 63; ++i) {
    EXPECT_EQ(command(base + i), i % 2 == 0 ? "DUPLICATE" : "STALE") << i;
  }
  EXPECT_EQ(command(base + 63), "execute");
  EXPECT_EQ(command(base), "DUPLICATE");
  EXPECT_EQ(command(base + 64), "execute");
  EXPECT_EQ(command(base), "STALE");
}

TEST_F(BoardLinkTest, CommandsGoOnOverTheWrap) {
  send_due();
  heartbeat(0xfffffffcU, 0);
  heartbeat(0xfffffffdU, sent.back());
  for (const std::uint32_t pnum : {0xfffffffeU, 0xffffffffU, 0U, 1U}) {
    EXPECT_EQ(command(pnum), "execute");
    EXPECT_EQ(command(pnum), "DUPLICATE");
  }
  EXPECT_EQ(command(0xfffffffdU), "STALE");
  EXPECT_EQ(link.last_executed(), 1U);
}

TEST_F(BoardLinkTest, ACommandIsLate250MsAfterAHeartbeatOvertookIt) {
  connect();
  heartbeat(echo_pnum + 10, sent.back());
  now += 250;
  EXPECT_EQ(command(echo_pnum + 5), "execute");
  now += 1;
  EXPECT_EQ(command(echo_pnum + 6), "STALE");
  EXPECT_EQ(command(echo_pnum + 11), "execute");  // overtaken by none
}

TEST_F(BoardLinkTest, TheFirstHeartbeatThatOvertookItCounts) {
  connect();
  for (std::uint32_t i = 0; i < 10; ++i) {
    heartbeat(echo_pnum + 10 + 2 * i, sent.back());
    run(50);
  }
  EXPECT_EQ(command(echo_pnum + 17), "STALE");    // 18 came 300 ms ago
  EXPECT_EQ(command(echo_pnum + 19), "execute");  // 20 came 250 ms ago
}

TEST_F(BoardLinkTest, TheFirstHeartbeatThatOvertookItCountsAtAnyRate) {
  connect();
  std::uint32_t pnum = echo_pnum + 10;
  const std::uint32_t held_back = pnum++;
  for (std::uint32_t ms = 0; ms <= 2 * BoardLink::late_limit_ms; ++ms) {
    ASSERT_EQ(heartbeat(pnum++, sent.back()), HeartbeatEffect::fed);
    if (ms > BoardLink::late_limit_ms) {
      Refusal code = Refusal::none;
      ASSERT_EQ(link.admit(here, held_back, now, code), Admission::refuse) << ms;
      ASSERT_EQ(code, Refusal::stale);
    }
    run(1);
  }
}

TEST_F(BoardLinkTest, ADeadHeartbeatOvertakesNothing) {
  connect();
  heartbeat(echo_pnum + 50, 0);  // stale
  now += 400;
  EXPECT_EQ(command(echo_pnum + 10), "execute");
}

TEST_F(BoardLinkTest, ARefusedNumberIsSpent) {
  connect();
  link.refused(here, echo_pnum + 5, Refusal::range);
  EXPECT_EQ(command(echo_pnum + 5), "RANGE") << "a copy is told why it was refused";
  EXPECT_EQ(command(echo_pnum + 4), "STALE");
  EXPECT_EQ(command(echo_pnum + 6), "execute");
  link.refused(there, echo_pnum + 50, Refusal::range);  // of another host: nothing
  EXPECT_EQ(command(echo_pnum + 7), "execute");
  link.refused(here, echo_pnum + 7 + 65537, Refusal::range);  // from outside the window: nothing
  EXPECT_EQ(command(echo_pnum + 8), "execute");
  EXPECT_EQ(link.last_executed(), echo_pnum + 8);
}

TEST_F(BoardLinkTest, WhileLostItRefusesAllButTellsOfDuplicates) {
  connect();
  command(echo_pnum + 5);
  run(1000);
  EXPECT_EQ(command(echo_pnum + 5), "DUPLICATE");
  EXPECT_EQ(command(echo_pnum + 6), "SAFE");
  EXPECT_EQ(command(echo_pnum + 6, there), "SAFE");
}

TEST_F(BoardLinkTest, ResumingSpendsWhatWasSentBefore) {
  connect();
  run(1000);
  heartbeat(echo_pnum + 9, sent.back());
  EXPECT_EQ(command(echo_pnum + 8), "STALE");
  EXPECT_EQ(command(echo_pnum + 10), "execute");
}

TEST_F(BoardLinkTest, ANewSessionForgetsTheNumbersOfTheOld) {
  connect();
  command(echo_pnum + 5);
  run(1000);
  heartbeat(echo_pnum + 100'000'000, sent.back(), there);
  EXPECT_EQ(link.last_executed(), 0U);
  EXPECT_EQ(command(echo_pnum + 6, here), "BUSY");
  EXPECT_EQ(command(echo_pnum + 100'000'000, there), "STALE");  // not DUPLICATE
  EXPECT_EQ(command(echo_pnum + 100'000'001, there), "execute");
}

TEST_F(BoardLinkTest, TellsItsHostSinceWhichEchoItRemembersCommands) {
  std::uint32_t first = 0;
  EXPECT_FALSE(link.session_of(here, first));
  heartbeat(echo_pnum, 0);
  EXPECT_FALSE(link.session_of(here, first)) << "it may be of before a reboot";
  send_due();
  heartbeat(echo_pnum + 1, sent.back());
  EXPECT_TRUE(link.session_of(here, first));
  EXPECT_EQ(first, echo_pnum + 1);
  EXPECT_FALSE(link.session_of(there, first));
  run(1000);  // lost, and resumed
  heartbeat(echo_pnum + 2, sent.back());
  EXPECT_TRUE(link.session_of(here, first));
  EXPECT_EQ(first, echo_pnum + 1);
  run(1000);
  heartbeat(echo_pnum + 3, sent.back(), there);  // from another address: another session
  EXPECT_FALSE(link.session_of(here, first));
  EXPECT_TRUE(link.session_of(there, first));
  EXPECT_EQ(first, echo_pnum + 3);
}

TEST_F(BoardLinkTest, ASessionWithoutNumbersHasNoneToTell) {
  BoardLink::HostHeartbeat plain;
  plain.from = here;
  link.on_heartbeat(plain, now);
  std::uint32_t first = 0;
  EXPECT_FALSE(link.session_of(here, first));
}

// --- the board's own heartbeats

TEST_F(BoardLinkTest, SendsAtOnceAndThenEachInterval) {
  send_due();
  run(2000);
  EXPECT_EQ(sent, (std::vector<std::uint32_t>{700'000, 700'500, 701'000, 701'500, 702'000}));
}

TEST_F(BoardLinkTest, SendsAtOnceOnEveryChange) {
  send_due();
  run(123);
  connect();
  EXPECT_EQ(sent.back(), 700'123U);  // ACTIVE
  run(1000);
  EXPECT_EQ(sent.back(), 701'123U);  // LOST
  run(77);
  heartbeat(echo_pnum + 2, sent.back());
  EXPECT_EQ(sent.back(), 701'200U);  // ACTIVE again
}

TEST_F(BoardLinkTest, AsksAnEchoHostAgainWhileItsEchoStaysAway) {
  connect();
  sent.clear();
  const std::uint32_t start = now;
  run(750);
  std::vector<std::uint32_t> times;
  for (const std::uint32_t t : sent) times.push_back(t - start);
  EXPECT_EQ(times, (std::vector<std::uint32_t>{500, 600, 700}));
  heartbeat(echo_pnum + 2, sent.back());
  run(300);
  EXPECT_EQ(sent.size(), 3U);
}

TEST_F(BoardLinkTest, AnswersToOthersDoNotDelayTheRegularOnes) {
  connect();
  sent.clear();
  const std::uint32_t start = now;
  for (int i = 0; i < 500; ++i) {
    run(1);
    link.heartbeat_answered(now);
  }
  EXPECT_EQ(sent, std::vector<std::uint32_t>{start + 500});
}

TEST_F(BoardLinkTest, AnAnswerCanBeEchoed) {
  connect();
  run(1000);
  run(33);
  link.heartbeat_answered(now);
  const std::uint32_t answered = now;
  run(5);
  EXPECT_EQ(heartbeat(echo_pnum + 100'000'000, answered, there), HeartbeatEffect::new_session);
}

TEST_F(BoardLinkTest, WantsToAnswerOneWhoHasNothingToEcho) {
  // CONNECTING: whatever it echoes.
  EXPECT_TRUE(link.wants_answer(numbered(echo_pnum, 99, here), now));
  connect();
  run(500);
  // ACTIVE: only one that has heard nothing.
  EXPECT_FALSE(link.wants_answer(numbered(echo_pnum, 99, here), now));
  EXPECT_TRUE(link.wants_answer(numbered(echo_pnum, 0, here), now));
  link.heartbeat_answered(now);
  run(BoardLink::answer_spacing_ms - 1);
  EXPECT_FALSE(link.wants_answer(numbered(echo_pnum, 0, here), now));
  run(1);
  EXPECT_TRUE(link.wants_answer(numbered(echo_pnum, 0, here), now));
  // LOST: whatever it echoes.
  run(1000);
  EXPECT_TRUE(link.wants_answer(numbered(echo_pnum, 99, there), now));
}

TEST_F(BoardLinkTest, TellsExactlyWhenItNeedsTime) {
  connect();
  EXPECT_EQ(link.due_in(now), 500U);
  now += 499;
  EXPECT_EQ(link.due_in(now), 1U);
  now += 1;
  EXPECT_EQ(link.due_in(now), 0U);
  send_due();
  EXPECT_EQ(link.due_in(now), 100U);  // the echo
  heartbeat(echo_pnum + 2, sent.back());
  link.set_timing(BoardLink::Timing{500, 120});
  EXPECT_EQ(link.due_in(now), 120U);
  now += 119;
  EXPECT_FALSE(link.poll(now));
  EXPECT_EQ(link.due_in(now), 1U);
  now += 1;
  EXPECT_TRUE(link.poll(now));
  EXPECT_EQ(link.due_in(now), 0U);  // the heartbeat of LOST
  send_due();
  EXPECT_EQ(link.due_in(now), 500U);
}

TEST_F(BoardLinkTest, GoesOnOverTheWrapOfTheClock) {
  now = 0xffffffffU - 2500;
  connect();
  std::uint32_t pnum = echo_pnum + 2;
  for (int i = 0; i < 50; ++i) {
    run(100);
    if (sent.back() == 0) continue;
    ASSERT_EQ(heartbeat(pnum++, sent.back()), HeartbeatEffect::fed) << i;
    ASSERT_EQ(command(pnum++), "execute") << i;
  }
  EXPECT_LT(now, 10'000U);
  run(1000);
  EXPECT_EQ(link.state(), BoardLinkState::lost);
  EXPECT_EQ(heartbeat(pnum, sent.back()), HeartbeatEffect::resumed);
}

}  // namespace
}  // namespace r4
