// SPDX-License-Identifier: GPL-3.0-or-later
// The board's end of the link in virtual time: which heartbeats feed it, and which commands it
// accepts.
#include "board_link_fixture.hpp"

namespace r4 {
namespace {

// --- sessions

TEST_F(BoardLinkTest, BeginsConnecting) {
  EXPECT_EQ(link.state(), BoardLinkState::connecting);
  EXPECT_FALSE(link.has_owner());
  EXPECT_FALSE(link.is_session_of(ours));
  EXPECT_EQ(link.last_executed(), 0U);
  EXPECT_EQ(command(1), "SAFE");
}

TEST_F(BoardLinkTest, TheFirstHostThatEchoesIsInControl) {
  send_due();
  EXPECT_EQ(heartbeat(first_number, 0), HeartbeatEffect::unheard);
  EXPECT_EQ(heartbeat(1, 0, other), HeartbeatEffect::unheard);
  EXPECT_EQ(link.state(), BoardLinkState::connecting);
  EXPECT_EQ(heartbeat(2, answer(), other), HeartbeatEffect::new_session);
  EXPECT_EQ(heartbeat(first_number + 1, now), HeartbeatEffect::busy);
  EXPECT_TRUE(link.is_session_of(other));
  EXPECT_FALSE(link.is_session_of(ours));
  EXPECT_EQ(command(first_number + 2), "BUSY");
  EXPECT_EQ(command(3, other), "execute");
}

TEST_F(BoardLinkTest, AnEchoOfAnotherBootStartsNoSession) {
  EXPECT_EQ(heartbeat(first_number, 123), HeartbeatEffect::unheard);
  EXPECT_EQ(link.state(), BoardLinkState::connecting);
}

TEST_F(BoardLinkTest, AnotherSessionIsAlwaysAnsweredBusy) {
  connect();
  const HostId strangers[] = {other, {there, 0x2222}, paper, {there, no_session}};
  for (const HostId stranger : strangers) {
    EXPECT_EQ(heartbeat(first_number + 2, sent.back(), stranger), HeartbeatEffect::busy);
    EXPECT_EQ(heartbeat(first_number + 5000, 0, stranger), HeartbeatEffect::busy);
    EXPECT_EQ(numberless(sent.back(), stranger), HeartbeatEffect::busy);
    EXPECT_EQ(command(first_number + 2, stranger), "BUSY");
  }
  EXPECT_EQ(heartbeat(first_number + 2, sent.back()), HeartbeatEffect::fed);
}

TEST_F(BoardLinkTest, ASessionIsTheSameFromEveryPeer) {
  connect();
  EXPECT_EQ(heartbeat(first_number + 2, sent.back(), {there, ours.sid}), HeartbeatEffect::fed);
  EXPECT_EQ(heartbeat(first_number + 2, sent.back()), HeartbeatEffect::repeated);
  EXPECT_EQ(command(first_number + 3, {there, ours.sid}), "execute");
  EXPECT_EQ(command(first_number + 3), "DUPLICATE");
}

TEST_F(BoardLinkTest, OnlyTheSameSessionResumes) {
  for (const bool same : {true, false}) {
    begin_anew();
    run(1000);
    const HostId host = same ? HostId{there, ours.sid} : other;
    EXPECT_EQ(heartbeat(first_number + 2, sent.back(), host),
              same ? HeartbeatEffect::resumed : HeartbeatEffect::new_session);
    EXPECT_EQ(command(first_number + 3, host), "execute");
  }
}

TEST_F(BoardLinkTest, AReplacedSessionReturnsOnlyWithAFreshEcho) {
  connect();
  command(first_number + 2);
  run(1000);
  heartbeat(1, sent.back(), other);
  const std::uint32_t before = sent.back();
  run(1000);
  EXPECT_EQ(heartbeat(first_number + 4, before), HeartbeatEffect::unheard);
  EXPECT_EQ(heartbeat(first_number + 5, sent.back()), HeartbeatEffect::new_session);
  EXPECT_EQ(link.last_executed(), 0U);
  EXPECT_EQ(command(first_number + 3), "STALE");
}

TEST_F(BoardLinkTest, ASessionCannotReturnAfterItsFarewell) {
  connect();
  link.leave(now);
  EXPECT_EQ(link.state(), BoardLinkState::lost);
  run(10);
  const std::uint32_t echo = answer();
  EXPECT_EQ(heartbeat(first_number + 2, echo), HeartbeatEffect::unheard);
  EXPECT_EQ(command(first_number + 3), "SAFE");
  EXPECT_EQ(heartbeat(1, echo, other), HeartbeatEffect::new_session);
}

TEST_F(BoardLinkTest, RemembersTheLastSessionsEndedByFarewell) {
  connect();
  for (SessionId sid = 1; sid <= BoardLink::left_memory + 1; ++sid) {
    link.leave(now);
    run(10);
    ASSERT_EQ(heartbeat(1, answer(), {here, sid}), HeartbeatEffect::new_session);
  }
  run(1000);
  const std::uint32_t echo = answer();
  for (SessionId sid = 1; sid <= BoardLink::left_memory; ++sid) {
    EXPECT_EQ(heartbeat(9, echo, {here, sid}), HeartbeatEffect::unheard) << sid;
  }
}

TEST_F(BoardLinkTest, AHostWithASessionIdMustNumberItsHeartbeats) {
  connect();
  EXPECT_EQ(numberless(sent.back(), ours), HeartbeatEffect::stale);
}

TEST_F(BoardLinkTest, LosesASilentHostExactlyAtTheTimeout) {
  connect();
  const std::uint32_t fed = now;
  run(2000);
  EXPECT_EQ(lost_at - fed, 1000U);
  EXPECT_EQ(link.state(), BoardLinkState::lost);
  EXPECT_FALSE(link.has_owner());
  EXPECT_TRUE(link.is_session_of(ours));
  EXPECT_EQ(link.fed_ms(), fed);
}

TEST_F(BoardLinkTest, ReportsTheLossOnce) {
  connect();
  now += 1000;
  EXPECT_TRUE(link.poll(now));
  EXPECT_FALSE(link.poll(now));
  EXPECT_FALSE(link.poll(now + 5000));
}

TEST_F(BoardLinkTest, TheSameHostResumesWithAnEchoFromAfterTheLoss) {
  connect();
  run(900);
  const std::uint32_t before = sent.back();
  run(100);
  ASSERT_EQ(link.state(), BoardLinkState::lost);
  EXPECT_GE(sent.back(), lost_at);
  EXPECT_EQ(heartbeat(first_number + 2, before), HeartbeatEffect::unheard);
  EXPECT_EQ(heartbeat(first_number + 4, sent.back()), HeartbeatEffect::resumed);
}

TEST_F(BoardLinkTest, AHostResumesAfterSendingMuchDuringAnOutage) {
  connect();
  run(1000);
  const std::uint32_t next = first_number + 2 + 3 * BoardLink::command_window;
  EXPECT_EQ(heartbeat(next, sent.back()), HeartbeatEffect::resumed);
  EXPECT_EQ(command(next - 1), "STALE");
  EXPECT_EQ(command(next + 1), "execute");
}

// A host can echo the heartbeat of the millisecond in which the link was lost both before and after
// the loss.
TEST_F(BoardLinkTest, ADuplicateOfAnOldHeartbeatDoesNotResumeTheSession) {
  connect();
  command(first_number + 2);
  now += 400;
  link.heartbeat_sent(now);
  link.shown(now);
  ASSERT_EQ(heartbeat(first_number + 3, now), HeartbeatEffect::fed);
  ASSERT_TRUE(link.lose(now));
  EXPECT_EQ(heartbeat(first_number + 3, now), HeartbeatEffect::stale);
  EXPECT_EQ(command(first_number + 2), "DUPLICATE");
}

TEST_F(BoardLinkTest, AHostIsServedAfterWeeksOfSilence) {
  connect();
  now += 2000;
  ASSERT_TRUE(link.poll(now));
  for (int day = 0; day < 30; ++day) {  // longer than half the range of the clock
    now += 24U * 3600 * 1000;
    send_due();
  }
  now += 5;
  ASSERT_EQ(heartbeat(first_number + 2, sent.back()), HeartbeatEffect::resumed);
  EXPECT_TRUE(link.heartbeat_due(now + BoardLink::echo_retry_ms))
      << "the board asks for its echo again";
}

// --- fresh echoes

TEST_F(BoardLinkTest, OnlyAFreshEchoKeepsTheLinkAlive) {
  connect();
  const std::uint32_t echoed = sent.back();
  run(999);
  // not a T of this board
  EXPECT_EQ(heartbeat(first_number + 2, echoed + 1), HeartbeatEffect::stale);
  EXPECT_EQ(heartbeat(first_number + 3, now + 5), HeartbeatEffect::stale);  // in the future
  EXPECT_EQ(heartbeat(first_number + 4, 0), HeartbeatEffect::unheard);
  EXPECT_EQ(heartbeat(first_number + 5, (std::uint64_t{1} << 32) + sent.back()),
            HeartbeatEffect::stale);
  EXPECT_EQ(link.state(), BoardLinkState::active);
  run(1);
  EXPECT_EQ(link.state(), BoardLinkState::lost);
}

TEST_F(BoardLinkTest, AnEchoIsFreshUpToTheTimeout) {
  connect();
  const std::uint32_t echoed = sent.back();
  run(500);
  EXPECT_EQ(heartbeat(first_number + 2, echoed), HeartbeatEffect::fed);
  run(500);
  EXPECT_EQ(heartbeat(first_number + 3, echoed), HeartbeatEffect::fed);
  run(1);
  EXPECT_EQ(heartbeat(first_number + 4, echoed), HeartbeatEffect::stale);
}

TEST_F(BoardLinkTest, ARepeatedOrOvertakenHeartbeatDoesNotCount) {
  connect();
  run(400);
  EXPECT_EQ(heartbeat(first_number + 3, sent.back()), HeartbeatEffect::fed);
  EXPECT_EQ(heartbeat(first_number + 3, sent.back()), HeartbeatEffect::repeated);
  EXPECT_EQ(heartbeat(first_number + 2, sent.back()), HeartbeatEffect::repeated);
  EXPECT_EQ(link.fed_ms(), now);
  run(100);
  EXPECT_EQ(heartbeat(first_number + 3, sent.back()), HeartbeatEffect::repeated);
  EXPECT_EQ(link.fed_ms(), now - 100);
}

// --- heartbeats that may have waited before they are read

TEST_F(BoardLinkTest, AWaitingHeartbeatCountsFromItsEarliestArrival) {
  connect();
  run(900);
  const std::uint32_t read = now;
  ASSERT_EQ(late(300, first_number + 2, sent[sent.size() - 4]), HeartbeatEffect::fed);
  EXPECT_EQ(link.fed_ms(), read - 300);
  EXPECT_EQ(link.deadline_ms(), read + 700);
  run(1000);
  EXPECT_EQ(lost_at, read + 700);
}

TEST_F(BoardLinkTest, AHeartbeatCountsNoEarlierThanTheTimeItEchoes) {
  connect();
  run(900);
  ASSERT_LT(now - sent.back(), 300U);
  ASSERT_EQ(late(300, first_number + 2, sent.back()), HeartbeatEffect::fed);
  EXPECT_EQ(link.fed_ms(), sent.back());
}

TEST_F(BoardLinkTest, AWaitingHeartbeatDoesNotShortenTheDeadline) {
  connect();
  run(100);
  const std::uint32_t fed = link.fed_ms();
  ASSERT_EQ(late(500, first_number + 2, sent.front()), HeartbeatEffect::fed);
  EXPECT_EQ(link.fed_ms(), fed);
}

TEST_F(BoardLinkTest, AHeartbeatThatMayBeOlderThanTheTimeoutDoesNothing) {
  EXPECT_EQ(late(1000, 1, 5, paper), HeartbeatEffect::unheard);
  EXPECT_EQ(link.state(), BoardLinkState::connecting);
  ASSERT_EQ(late(999, 1, 5, paper), HeartbeatEffect::new_session);
  EXPECT_EQ(link.deadline_ms(), now + 1);
  run(500);
  ASSERT_EQ(link.state(), BoardLinkState::lost);
  EXPECT_EQ(late(1000, 2, 6, paper), HeartbeatEffect::unheard);
  EXPECT_EQ(late(1000, 7, 6, other), HeartbeatEffect::unheard);
  EXPECT_EQ(link.state(), BoardLinkState::lost);
  ASSERT_EQ(late(400, 2, 6, paper), HeartbeatEffect::new_session);
  EXPECT_EQ(link.deadline_ms(), now + 600);
}

TEST_F(BoardLinkTest, LatenessCountsFromAHeartbeatsEarliestArrival) {
  heartbeat(1, 5, paper);
  run(400);
  late(251, 10, 6, paper);
  EXPECT_EQ(command(9, paper), "STALE");
  EXPECT_EQ(command(11, paper), "execute");
  run(400);
  late(250, 20, 7, paper);
  EXPECT_EQ(command(19, paper), "execute");
}

// --- commands

TEST_F(BoardLinkTest, ExecutesEachCommandOnceAndNeverAnOlderOne) {
  connect();
  EXPECT_EQ(command(first_number + 5), "execute");
  EXPECT_EQ(command(first_number + 5), "DUPLICATE");
  EXPECT_EQ(command(first_number + 4), "STALE");
  EXPECT_EQ(command(first_number + 6), "execute");
  EXPECT_EQ(command(first_number + 5), "DUPLICATE");
}

TEST_F(BoardLinkTest, AcceptsCommandsUpTo65536NumbersAhead) {
  connect();
  command(first_number + 2);
  EXPECT_EQ(command(first_number + 2 + 65537), "STALE");
  EXPECT_EQ(command(first_number + 2 + 65536), "execute");
}

TEST_F(BoardLinkTest, RemembersExactly64Numbers) {
  connect();
  const std::uint32_t base = first_number + 2;
  for (std::uint32_t i = 0; i < 64; i += 2) EXPECT_EQ(command(base + i), "execute");
  for (std::uint32_t i = 0; i < 63; ++i) {
    EXPECT_EQ(command(base + i), i % 2 == 0 ? "DUPLICATE" : "STALE") << i;
  }
  EXPECT_EQ(command(base + 63), "execute");
  EXPECT_EQ(command(base), "DUPLICATE");
  EXPECT_EQ(command(base + 64), "execute");
  EXPECT_EQ(command(base), "STALE");
}

TEST_F(BoardLinkTest, CommandsContinueWhenTheNumbersWrap) {
  send_due();
  heartbeat(0xfffffffcU, 0);
  heartbeat(0xfffffffdU, answer());
  for (const std::uint32_t pnum : {0xfffffffeU, 0xffffffffU, 0U, 1U}) {
    EXPECT_EQ(command(pnum), "execute");
    EXPECT_EQ(command(pnum), "DUPLICATE");
  }
  EXPECT_EQ(command(0xfffffffdU), "STALE");
  EXPECT_EQ(link.last_executed(), 1U);
}

TEST_F(BoardLinkTest, ACommandIsLate250MsAfterAHeartbeatOvertookIt) {
  connect();
  heartbeat(first_number + 10, sent.back());
  now += 250;
  EXPECT_EQ(command(first_number + 5), "execute");
  now += 1;
  EXPECT_EQ(command(first_number + 6), "STALE");
  EXPECT_EQ(command(first_number + 11), "execute");  // not overtaken
}

TEST_F(BoardLinkTest, LatenessCountsFromTheFirstOvertakingHeartbeat) {
  connect();
  for (std::uint32_t i = 0; i < 10; ++i) {
    heartbeat(first_number + 10 + 2 * i, sent.back());
    run(50);
  }
  EXPECT_EQ(command(first_number + 17), "STALE");    // heartbeat 18 arrived 300 ms ago
  EXPECT_EQ(command(first_number + 19), "execute");  // heartbeat 20 arrived 250 ms ago
}

TEST_F(BoardLinkTest, LatenessCountsFromTheFirstHeartbeatAtAnyRate) {
  connect();
  std::uint32_t pnum = first_number + 10;
  const std::uint32_t held_back = pnum++;
  for (std::uint32_t ms = 0; ms <= 2 * BoardLink::late_limit_ms; ++ms) {
    ASSERT_EQ(heartbeat(pnum++, sent.back()), HeartbeatEffect::fed);
    if (ms > BoardLink::late_limit_ms) {
      ASSERT_EQ(link.admit(ours, held_back, now), Refusal::stale) << ms;
    }
    run(1);
  }
}

TEST_F(BoardLinkTest, AStaleHeartbeatMakesNoCommandLate) {
  connect();
  heartbeat(first_number + 50, 0);  // stale
  now += 400;
  EXPECT_EQ(command(first_number + 10), "execute");
}

TEST_F(BoardLinkTest, ARefusedNumberIsUsedUp) {
  connect();
  link.refused(ours, first_number + 5, Refusal::range);
  EXPECT_EQ(command(first_number + 5), "RANGE")
      << "the board answers a duplicate with the reason of its refusal";
  EXPECT_EQ(command(first_number + 4), "STALE");
  EXPECT_EQ(command(first_number + 6), "execute");
  link.refused(other, first_number + 50, Refusal::range);  // from another host, so it has no effect
  EXPECT_EQ(command(first_number + 7), "execute");
  link.refused(ours, first_number + 7 + 65537, Refusal::range);  // outside the window: no effect
  EXPECT_EQ(command(first_number + 8), "execute");
  EXPECT_EQ(link.last_executed(), first_number + 8);
}

TEST_F(BoardLinkTest, RefusesCommandsWhileLostButReportsDuplicates) {
  connect();
  command(first_number + 5);
  run(1000);
  EXPECT_EQ(command(first_number + 5), "DUPLICATE");
  EXPECT_EQ(command(first_number + 6), "SAFE");
  EXPECT_EQ(command(first_number + 6, other), "SAFE");
}

TEST_F(BoardLinkTest, ResumingMakesEarlierCommandsStale) {
  connect();
  run(1000);
  heartbeat(first_number + 9, sent.back());
  EXPECT_EQ(command(first_number + 8), "STALE");
  EXPECT_EQ(command(first_number + 10), "execute");
}

TEST_F(BoardLinkTest, ANewSessionForgetsTheNumbersOfTheOld) {
  connect();
  command(first_number + 5);
  run(1000);
  heartbeat(first_number + 100'000'000, sent.back(), other);
  EXPECT_EQ(link.last_executed(), 0U);
  EXPECT_EQ(command(first_number + 6), "BUSY");
  EXPECT_EQ(command(first_number + 100'000'000, other), "STALE");  // not DUPLICATE
  EXPECT_EQ(command(first_number + 100'000'001, other), "execute");
}

TEST_F(BoardLinkTest, ReportsWhichHeartbeatStartedTheSession) {
  std::uint32_t first = 0;
  EXPECT_FALSE(link.first_heartbeat(ours, first));
  connect();
  EXPECT_TRUE(link.first_heartbeat(ours, first));
  EXPECT_EQ(first, first_number + 1);
  EXPECT_FALSE(link.first_heartbeat(other, first));
  run(1000);  // the link is lost and resumed
  heartbeat(first_number + 2, sent.back());
  EXPECT_TRUE(link.first_heartbeat(ours, first));
  EXPECT_EQ(first, first_number + 1);
  run(1000);
  heartbeat(3, sent.back(), other);
  EXPECT_FALSE(link.first_heartbeat(ours, first));
  EXPECT_TRUE(link.first_heartbeat(other, first));
  EXPECT_EQ(first, 3U);
  run(1000);
  numberless(5);
  EXPECT_FALSE(link.first_heartbeat(paper, first)) << "the heartbeats of this host have no numbers";
}

// --- the board's own heartbeats

TEST_F(BoardLinkTest, SendsAHeartbeatAtOnceAndThenEachInterval) {
  send_due();
  run(2000);
  EXPECT_EQ(sent, (std::vector<std::uint32_t>{700'000, 700'500, 701'000, 701'500, 702'000}));
}

TEST_F(BoardLinkTest, SendsAHeartbeatAtOnceOnEveryChange) {
  send_due();
  run(123);
  connect();
  EXPECT_EQ(sent.back(), 700'123U);  // ACTIVE
  run(1000);
  EXPECT_EQ(sent.back(), 701'123U);  // LOST
  run(77);
  heartbeat(first_number + 2, sent.back());
  EXPECT_EQ(sent.back(), 701'200U);  // ACTIVE again
}

TEST_F(BoardLinkTest, RepeatsHeartbeatsWhileTheEchoIsMissing) {
  connect();
  sent.clear();
  const std::uint32_t start = now;
  run(750);
  std::vector<std::uint32_t> times;
  for (const std::uint32_t t : sent) times.push_back(t - start);
  EXPECT_EQ(times, (std::vector<std::uint32_t>{500, 600, 700}));
  heartbeat(first_number + 2, sent.back());
  run(300);
  EXPECT_EQ(sent.size(), 3U);
}

TEST_F(BoardLinkTest, AnswersDoNotDelayTheRegularHeartbeats) {
  connect();
  sent.clear();
  const std::uint32_t start = now;
  for (int i = 0; i < 500; ++i) {
    run(1);
    answer();
  }
  EXPECT_EQ(sent, std::vector<std::uint32_t>{start + 500});
}

TEST_F(BoardLinkTest, AnAnswerCanBeEchoed) {
  connect();
  run(1000);
  run(33);
  const std::uint32_t answered = answer();
  run(5);
  EXPECT_EQ(heartbeat(first_number + 100'000'000, answered, other), HeartbeatEffect::new_session);
}

TEST_F(BoardLinkTest, AHostThatMayHaveNothingToEchoIsAnswered) {
  EXPECT_EQ(heartbeat(first_number, 99), HeartbeatEffect::unheard);
  connect();
  run(500);
  // In ACTIVE, the controlling host receives the regular heartbeats, so it gets an answer only on a
  // new path.
  EXPECT_EQ(heartbeat(first_number + 2, 99), HeartbeatEffect::stale);
  EXPECT_EQ(heartbeat(first_number + 2, 0), HeartbeatEffect::unheard);
  run(1000);
  EXPECT_EQ(heartbeat(first_number + 3, 99), HeartbeatEffect::unheard);
  EXPECT_EQ(heartbeat(1, 99, other), HeartbeatEffect::unheard);
}

TEST_F(BoardLinkTest, ManyQuestionsDoNotInvalidateAnotherHostsEcho) {
  connect();
  run(1000);
  const std::uint32_t echo = answer();
  for (int i = 0; i < 999; ++i) {
    run(1);
    const std::uint32_t t = answer();
    EXPECT_LT(now - t, BoardLink::answer_spacing_ms);
  }
  EXPECT_EQ(heartbeat(first_number + 2, echo), HeartbeatEffect::resumed);
}

TEST_F(BoardLinkTest, AnAnswerSentAfterALossCanBeEchoed) {
  connect();
  answer();
  run(2);
  ASSERT_TRUE(link.lose(now));
  ASSERT_EQ(heartbeat(first_number + 2, answer()), HeartbeatEffect::resumed);
}

TEST_F(BoardLinkTest, ReportsExactlyWhenItIsDue) {
  connect();
  EXPECT_EQ(link.due_in(now), 500U);
  now += 499;
  EXPECT_EQ(link.due_in(now), 1U);
  now += 1;
  EXPECT_EQ(link.due_in(now), 0U);
  send_due();
  EXPECT_EQ(link.due_in(now), 100U);  // until the board repeats the heartbeat to get an echo
  heartbeat(first_number + 2, sent.back());
  link.set_timing(BoardLink::Timing{500, 120});
  EXPECT_EQ(link.due_in(now), 120U);
  now += 119;
  EXPECT_FALSE(link.poll(now));
  EXPECT_EQ(link.due_in(now), 1U);
  now += 1;
  EXPECT_TRUE(link.poll(now));
  EXPECT_EQ(link.due_in(now), 0U);  // the heartbeat of LOST is due
  send_due();
  EXPECT_EQ(link.due_in(now), 500U);
}

TEST_F(BoardLinkTest, ContinuesWhenTheClockWraps) {
  now = 0xffffffffU - 2500;
  connect();
  std::uint32_t pnum = first_number + 2;
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
