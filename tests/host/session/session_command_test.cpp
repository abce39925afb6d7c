// SPDX-License-Identifier: GPL-3.0-or-later
// How commands end: confirmed by the board's state, refused, timed out, cancelled.
#include <gtest/gtest.h>

#include "host/session/session.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/error.hpp"
#include "scripted_link.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

using SessionCommand = ConnectedSession;
using SessionStop = ConnectedSession;
using SessionClear = ConnectedSession;
using SessionRefusal = ConnectedSession;
using SessionBusy = ConnectedSession;

TEST_F(SessionCommand, GoesOutAtOnceAndIsConfirmedByItsNumberInTheState) {
  const Ticket ticket = link.session.send(turn_motor, 1s, link.now);
  const auto sent = link.last('O');
  EXPECT_EQ(sent.command, "O:358,1,1");
  EXPECT_EQ(sent.at, link.now);
  EXPECT_EQ(sent.priority, Priority::normal);
  link.pass(7ms);
  link.executed(sent.pnum - 1);
  link.state("OSMC1:358,1;SAFE:0;CMD:1;");
  EXPECT_TRUE(under_way(ticket)) << "the value alone does not prove it";
  link.executed(sent.pnum);
  EXPECT_EQ(outcome(ticket), Outcome::confirmed);
  EXPECT_EQ(result(ticket).elapsed, 7ms);
  link.pass(1s);
  EXPECT_EQ(link.count('O'), 1U);
}

TEST_F(NewSession, HoldsCommandsUntilTheLinkIsUpAndKeepsTheirOrder) {
  const Ticket first = link.session.send(turn_motor, 5s, link.now);
  const Ticket second = link.session.send(Command::servo(2, Microseconds(1500)), 5s, link.now);
  EXPECT_FALSE(link.session.post(turn_motor, link.now)) << "a post must not wait";
  link.pass(200ms);
  EXPECT_EQ(link.count('O') + link.count('S'), 0U);
  link.heartbeat();
  link.pass(10ms);
  EXPECT_EQ(link.count('O'), 0U) << "the board must obey once first";
  link.executed(link.last('F').pnum);
  ASSERT_EQ(link.count('O'), 1U);
  ASSERT_EQ(link.count('S'), 1U);
  EXPECT_LT(link.last('O').pnum, link.last('S').pnum);
  link.executed(link.last('O').pnum);
  link.executed(link.last('S').pnum);
  EXPECT_EQ(outcome(first), Outcome::confirmed);
  EXPECT_EQ(outcome(second), Outcome::confirmed);
}

TEST_F(SessionCommand, IsRepeatedWithTheSameBytesEveryFiftyMilliseconds) {
  link.session.send(turn_motor, 1s, link.now);
  const Time start = link.now;
  link.pass(499ms);
  const auto sent = link.all('O');
  ASSERT_EQ(sent.size(), 10U);
  for (std::size_t i = 0; i < sent.size(); ++i) {
    EXPECT_EQ(sent[i].bytes, sent[0].bytes);
    EXPECT_EQ(sent[i].at - start, i * 50ms);
  }
  EXPECT_EQ(link.session.statistics(link.now).retries, 9U);
  EXPECT_EQ(link.session.statistics(link.now).commands, 1U);
}

TEST_F(SessionCommand, EndsAtItsDeadline) {
  const Ticket ticket = link.session.send(turn_motor, 120ms, link.now);
  link.pass(119ms);
  EXPECT_TRUE(under_way(ticket));
  link.pass(1ms);
  EXPECT_EQ(outcome(ticket), Outcome::timed_out);
  EXPECT_EQ(result(ticket).elapsed, 120ms);
  link.pass(1s);
  EXPECT_EQ(link.count('O'), 3U) << "the command must not be sent again";
}

TEST_F(SessionCommand, IsRefusedWithTheBoardsCode) {
  const Ticket other = link.session.send(turn_motor, 1s, link.now);
  const Ticket ticket = link.session.send(Command::servo(2, Microseconds(1500)), 1s, link.now);
  link.pass(3ms);
  link.nack(link.last('S').pnum, "SAFE");
  EXPECT_EQ(outcome(ticket), Outcome::refused);
  EXPECT_EQ(result(ticket).code, Refusal::safe);
  EXPECT_TRUE(under_way(other));
  ASSERT_EQ(link.nacks.size(), 1U);
  EXPECT_EQ(link.session.statistics(link.now).refused, 1U);
}

TEST_F(SessionCommand, IsRepeatedAtOnceIfOvertakenAndEndsByTheAnswer) {
  for (const char* answer : {"DUPLICATE", "STALE"}) {
    link.sent.clear();
    const Ticket first = link.session.send(turn_motor, 1s, link.now);
    link.session.send(Command::servo(2, Microseconds(1500)), 1s, link.now);
    link.pass(10ms);
    link.executed(link.last('S').pnum);  // the state that confirms `first` was lost
    EXPECT_TRUE(under_way(first)) << "a CMD with a later number proves nothing";
    EXPECT_EQ(link.count('O'), 2U) << "the command must be repeated at once, not after 50 ms";
    link.nack(link.last('O').pnum, answer);
    const bool stale = *answer == 'S';
    EXPECT_EQ(outcome(first), stale ? Outcome::refused : Outcome::confirmed);
    EXPECT_EQ(result(first).code, stale ? Refusal::stale : Refusal::none);
  }
}

TEST_F(SessionCommand, WaitsForTheStateAfterADuplicateAnswer) {
  const Ticket ticket = link.session.send(turn_motor, 1s, link.now);
  link.pass(60ms);
  link.nack(link.last('O').pnum, "DUPLICATE");
  EXPECT_TRUE(under_way(ticket)) << "only the board's state confirms";
  link.executed(link.last('O').pnum);
  EXPECT_EQ(outcome(ticket), Outcome::confirmed);
}

TEST_F(NewSession, ConfirmsACommandByItsValueIfTheBoardHasNoCmd) {
  link.heartbeat();
  const Ticket ticket = link.session.send(turn_motor, 20s, link.now);
  link.send_states(300, "AIN24:24.28;OSMC1:0,0;");  // the paper's board has neither F nor CMD
  ASSERT_GE(link.count('O'), 1U) << "after a while the session must treat it as the paper's board";
  EXPECT_TRUE(under_way(ticket));
  link.state("AIN24:24.28;OSMC1:358,0;");
  EXPECT_TRUE(under_way(ticket)) << "the direction differs";
  link.state("AIN24:24.28;OSMC1:358,1;");
  EXPECT_EQ(outcome(ticket), Outcome::confirmed);
}

TEST_F(NewSession, RepeatsItsFieldsOnceASecondIfTheBoardDoesNotAnswer) {
  link.heartbeat();
  link.send_states(500, "AIN24:24.28;");
  EXPECT_EQ(link.count('F'), 5U + 4U) << "the first five are sent in the first second";
}

TEST_F(SessionCommand, IsRefusedOutsideItsRanges) {
  for (const Command& wrong :
       {Command::osmc(1, Pwm(4096), Direction::forward),
        Command::osmc(1, Pwm(-1), Direction::forward),
        Command::dhb12(0, Pwm(1), Direction::forward), Command::servo(17, Microseconds(1)),
        Command::proximity(1, Centimetres(401)), Command::fields(""), Command::setting("", "1"),
        Command::fields("A;B"), Command::setting("rate", "1^2")}) {
    const Problem problem = problem_of([&] { link.session.send(wrong, 1s, link.now); });
    EXPECT_EQ(problem.kind, ErrorKind::usage) << to_text(wrong);
    EXPECT_FALSE(problem.fix.empty()) << to_text(wrong);
    EXPECT_THROW(link.session.post(wrong, link.now), Error);
  }
  const std::string long_text(2000, 'A');
  EXPECT_THROW(link.session.send(Command::fields(long_text), 1s, link.now), Error);
  EXPECT_TRUE(link.sent.empty());
}

TEST_F(NewSession, TakesAtMostSixtyFourCommandsAndSixteenStops) {
  for (std::size_t i = 0; i < Session::max_pending; ++i) {
    EXPECT_NE(link.session.send(turn_motor, 1s, link.now), 0U);
  }
  EXPECT_EQ(link.session.send(turn_motor, 1s, link.now), 0U);
  EXPECT_EQ(link.session.send(Command::identify(), 1s, link.now), 0U);
  for (std::size_t i = 0; i < Session::max_stops; ++i) {
    EXPECT_NE(link.session.send(Command::stop(), 1s, link.now), 0U)
        << "other commands must not block a stop";
  }
  EXPECT_EQ(link.results.size(), Session::max_pending);
  EXPECT_EQ(link.session.send(Command::stop(), 1s, link.now), 0U);
  EXPECT_EQ(link.count('E'), Session::max_stops + 1) << "a stop must be sent even without room";
}

TEST_F(SessionCommand, SentOnceIsNotRepeatedAndDoesNotOvertakeEarlierCommands) {
  link.session.send(turn_motor, 1s, link.now);
  EXPECT_TRUE(link.session.post(Command::servo(1, Microseconds(0)), link.now));
  ASSERT_EQ(link.count('O'), 1U);
  EXPECT_LT(link.last('O').pnum, link.last('S').pnum);
  link.pass(1s);
  EXPECT_EQ(link.count('S'), 1U);
  EXPECT_EQ(link.results.size(), 1U) << "only the command that was sent has a result";
}

TEST_F(NewSession, DoesNotConfirmIdentifyByASecondAnswerToAnEarlierQuestion) {
  link.session.send(Command::identify(), 1s, link.now);
  const Ticket second = link.session.send(Command::identify(), 1s, link.now);
  const auto questions = link.all('Q');
  link.answer(questions[0].pnum);
  link.answer(questions[0].pnum);
  EXPECT_FALSE(link.results.contains(second));
  link.answer(questions[1].pnum);
  EXPECT_EQ(outcome(second), Outcome::confirmed);
}

TEST_F(SessionCommand, IsNotRepeatedAfterItsCancellation) {
  const Ticket ticket = link.session.send(turn_motor, 1s, link.now);
  link.session.cancel(ticket, link.now);
  EXPECT_EQ(outcome(ticket), Outcome::cancelled);
  link.pass(2s);
  EXPECT_EQ(link.results.size(), 1U);
  EXPECT_EQ(link.count('O'), 1U);
}

TEST_F(SessionStop, CannotBeCancelled) {
  const Ticket stop = link.session.send(Command::stop(), 1s, link.now);
  link.session.cancel(stop, link.now);
  EXPECT_TRUE(link.results.empty());
  link.pass(100ms);
  EXPECT_GT(link.count('E'), 3U) << "the stop must be repeated";
}

TEST_F(SessionStop, IsRepeatedEveryTwentyMillisecondsUntilTheBoardReportsIt) {
  const Time start = link.now;
  const Ticket ticket = link.session.send(Command::stop(), 1s, link.now);
  link.pass(50ms);
  link.executed(1);
  EXPECT_TRUE(under_way(ticket));
  link.pass(49ms);
  const auto sent = link.all('E');
  ASSERT_EQ(sent.size(), 5U);
  for (std::size_t i = 0; i < sent.size(); ++i) {
    EXPECT_EQ(sent[i].at - start, i * 20ms);
    EXPECT_EQ(sent[i].bytes, sent[0].bytes);
  }
  link.heartbeat(SafeReason::stop);
  link.state("SAFE:2;");
  link.stopped(sent[0].pnum - 1);
  EXPECT_TRUE(under_way(ticket)) << "only the number of this stop confirms";
  link.stopped(sent[0].pnum);
  EXPECT_EQ(outcome(ticket), Outcome::confirmed);
}

TEST_F(SessionStop, IsRepeatedForAWhileAfterItsConfirmation) {
  link.session.send(Command::stop(), 1s, link.now);
  link.stopped(link.last('E').pnum);
  link.pass(1s);
  EXPECT_EQ(link.count('E'), 10U) << "every 20 ms for 200 ms";
  EXPECT_EQ(link.session.statistics(link.now).confirmed, 1U);
  EXPECT_EQ(link.session.statistics(link.now).timed_out, 0U) << "a command must end only once";
  EXPECT_EQ(link.last('E').bytes, link.all('E').front().bytes);

  link.executed(link.last('E').pnum);  // the host is in control again after a second of silence
  for (const bool posts : {false, true}) {
    link.session.send(Command::stop(), 1s, link.now);
    link.stopped(link.last('E').pnum);
    link.pass(30ms);
    if (posts) {
      EXPECT_EQ(link.session.post(Command::clear(), link.now), PostResult::sent);
    } else {
      link.session.send(Command::clear(), 1s, link.now);
    }
    ASSERT_EQ(link.last('E').command.substr(0, 7), "E:CLEAR");
    const std::size_t stops = link.count('E');
    link.pass(40ms);
    EXPECT_EQ(link.count('E'), stops) << "a stop must not be repeated after the host's own E:CLEAR";
    link.executed(link.last('E').pnum);
  }
}

// --- E:CLEAR

TEST_F(SessionClear, NamesTheCauseKnownAtTheCall) {
  link.stopped(1, 7);
  link.session.send(Command::clear(), 1s, link.now);
  EXPECT_EQ(link.last('E').command, "E:CLEAR,7");
  link.heartbeat();
  link.session.post(Command::clear(), link.now);
  EXPECT_EQ(link.last('E').command, "E:CLEAR,0");
}

TEST_F(NewSession, NamesTheFirstReportedCauseInAnEarlyClear) {
  const Ticket ticket = link.session.send(Command::clear(), 1s, link.now);
  link.stopped(1, 7);
  link.pass(10ms);
  link.state("SAFE:2;CMD:" + std::to_string(link.last('F').pnum) + ";");
  EXPECT_EQ(link.last('E').command, "E:CLEAR,7");
  EXPECT_TRUE(under_way(ticket));
}

TEST_F(SessionClear, IsCancelledWhenTheBoardReportsANewerCause) {
  link.stopped(1, 7);
  const Ticket sent = link.session.send(Command::clear(), 1s, link.now);
  link.stopped(1, 7);
  EXPECT_TRUE(under_way(sent));
  link.stopped(2, 8);  // a second stop
  EXPECT_EQ(outcome(sent), Outcome::cancelled);
  const std::size_t clears = link.count('E');
  link.pass(500ms);
  EXPECT_EQ(link.count('E'), clears) << "the E:CLEAR must not be repeated";
}

TEST_F(NewSession, DoesNotSendAWaitingClearPastANewerCause) {
  link.stopped(1, 7);
  const Ticket waits = link.session.send(Command::clear(), 1s, link.now);
  link.stopped(2, 8);
  EXPECT_EQ(outcome(waits), Outcome::cancelled);
  EXPECT_EQ(link.count('E'), 0U);
}

// --- refusals

TEST_F(SessionRefusal, OfALaterSessionDoesNotEndTheCommand) {
  const std::uint32_t ours = link.session_pnum;
  const Ticket ticket = link.session.send(turn_motor, 10s, link.now);
  const std::uint32_t pnum = link.last('O').pnum;
  const auto refused_by = [&](std::uint32_t session, std::string_view code) {
    link.session_pnum = session;
    link.nack(pnum, code);
    return !under_way(ticket);
  };
  link.pass(100ms);
  EXPECT_FALSE(refused_by(0, "SAFE"))
      << "the host's address has changed, so the board treats it as a stranger";
  EXPECT_FALSE(refused_by(pnum + 1, "STALE")) << "the host's first heartbeat after an outage";
  EXPECT_FALSE(refused_by(99, "STALE")) << "the number of another session";
  link.pass(1100ms);
  ASSERT_EQ(link.session.link().state, HostLinkState::lost);
  link.heartbeat();
  EXPECT_FALSE(refused_by(link.last('H').pnum, "STALE"))
      << "the board may have executed it before the outage";
  // Only the direction to the host was cut, so the board continues the session.
  EXPECT_TRUE(refused_by(ours, "STALE"));
  EXPECT_EQ(outcome(ticket), Outcome::refused);
}

TEST_F(NewSession, AStopCancelsEveryCommand) {
  const Ticket queued = link.session.send(turn_motor, 5s, link.now);
  link.connect();
  const Ticket sent = link.session.send(Command::servo(2, Microseconds(1500)), 5s, link.now);
  link.session.send(Command::stop(), 1s, link.now);
  EXPECT_EQ(outcome(queued), Outcome::cancelled);
  EXPECT_EQ(outcome(sent), Outcome::cancelled);
  const std::size_t before = link.count('O') + link.count('S');
  link.pass(500ms);
  EXPECT_EQ(link.count('O') + link.count('S'), before);
}

TEST_F(NewSession, HoldsCommandsUntilTheOtherHostHasLeft) {
  link.nack(link.last('H').pnum, "BUSY");
  const Ticket ticket = link.session.send(turn_motor, 5s, link.now);
  for (int i = 0; i < 10; ++i) {
    EXPECT_TRUE(link.session.link().causes.has(LinkCause::busy));
    link.pass(100ms);
    link.nack(link.last('H').pnum, "BUSY");
  }
  EXPECT_EQ(link.count('O'), 0U);
  link.pass(301ms);
  EXPECT_FALSE(link.session.link().causes.has(LinkCause::busy)) << "the board has stopped refusing";
  link.heartbeat();
  link.pass(10ms);
  link.executed(link.last('F').pnum);
  ASSERT_EQ(link.count('O'), 1U);
  link.executed(link.last('O').pnum);
  EXPECT_EQ(outcome(ticket), Outcome::confirmed);
}

TEST_F(SessionBusy, AHostWithoutItsTurnOnTheBusMayOnlyStopTheBoard) {
  link.place_taken = true;
  const Ticket ticket = link.session.send(turn_motor, 5s, link.now);
  EXPECT_FALSE(link.session.post(turn_motor, link.now));
  for (int i = 0; i < 20; ++i) {
    link.pass(100ms);
    link.heartbeat();
    link.executed(0);
    EXPECT_TRUE(link.session.link().causes.has(LinkCause::busy));
  }
  EXPECT_EQ(link.sent.size(), 0U);
  EXPECT_FALSE(link.session.in_control(link.now));
  const Ticket stop = link.session.send(Command::stop(), 1s, link.now);
  EXPECT_EQ(link.count('E'), 1U);
  link.stopped(link.last('E').pnum);
  EXPECT_EQ(outcome(stop), Outcome::confirmed);
  EXPECT_EQ(outcome(ticket), Outcome::cancelled);

  link.place_taken = false;
  link.pass(400ms);
  EXPECT_FALSE(link.session.link().causes.has(LinkCause::busy));
}

}  // namespace
}  // namespace r4::test
