// SPDX-License-Identifier: GPL-3.0-or-later
// A session that must be armed: the commands that it does not send, the causes that disarm it, and
// arm().
#include <gtest/gtest.h>

#include "r4link/commands/command_text.hpp"
#include "r4link/link.hpp"
#include "scripted_link.hpp"
#include "tests/support/datagrams.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

struct MustArm : NewSession {
  MustArm() : NewSession(ScriptedLink::must_arm()) {}
  void state(SafeReason reason, std::uint32_t executed, bool relay) {
    link.state("RELAYS:" + std::to_string(static_cast<int>(relay)) + ";SAFE:" +
               std::to_string(static_cast<int>(reason)) + ";CMD:" + std::to_string(executed) + ";");
  }
  Ticket arm() {
    const Ticket ticket = link.session.arm(1s, link.now);
    link.pass(1ms);
    return ticket;
  }

  std::uint32_t cmd = 0;
};

struct SessionArming : MustArm {
  SessionArming() { link.connect(); }
  // The board executes the newest command with that letter.
  void execute(char letter, SafeReason reason = SafeReason::none, bool relay = false) {
    cmd = link.last(letter).pnum;
    state(reason, cmd, relay);
  }
  void armed() {
    const Ticket ticket = arm();
    execute('R', SafeReason::none, true);
    ASSERT_EQ(outcome(ticket), Outcome::confirmed);
    ASSERT_EQ(link.session.disarmed_by(), DisarmCause::none);
    link.sent.clear();
  }
  PostResult post() { return link.session.post(turn_motor, link.now); }
  // The link is lost, and then heartbeats arrive again. Relay 1 shows whether the board has
  // restored its outputs.
  void outage(bool relay) {
    link.pass(1500ms);
    EXPECT_EQ(post(), PostResult::no_link);
    link.heartbeat(SafeReason::link);
    link.pass(10ms);
    link.heartbeat();
    link.pass(10ms);
    state(SafeReason::none, link.last('F').pnum, relay);
  }
};

TEST_F(SessionArming, ASessionBeginsDisarmedAndReportsThatToCommands) {
  EXPECT_EQ(link.session.disarmed_by(), DisarmCause::not_yet);
  EXPECT_EQ(post(), PostResult::not_armed);
  const Ticket ticket = link.session.send(turn_motor, 1s, link.now);
  link.pass(1ms);
  EXPECT_EQ(outcome(ticket), Outcome::not_armed);
  const Problem problem = explain(Command::osmc(1, Pwm(358), Direction::forward),
                                  link.results[ticket], link.session.link());
  EXPECT_EQ(problem.reason, "not armed: a session begins disarmed");
  EXPECT_EQ(problem.fix, "call arm()");
  EXPECT_EQ(link.count('O'), 0U);
  EXPECT_EQ(link.session.statistics(link.now).refused, 2U);
}

TEST_F(SessionArming, HoldsBackOutputCommandsOnly) {
  for (const char* text : {"D:1,1,1", "S:1500,1", "R:1,1", "P:5,1", "Z:1", "B:1,1,0,1"}) {
    const OwnCommand command = parse_command_text(text);
    EXPECT_EQ(link.session.post(command, link.now), PostResult::not_armed) << text;
  }
  for (const char* text : {"U:15,1", "F:ENC1", "C:rate,10", "E:CLEAR"}) {
    const OwnCommand command = parse_command_text(text);
    EXPECT_EQ(link.session.post(command, link.now), PostResult::sent) << text;
  }
  const Setpoints group{turn_motor, Command::servo(1, Microseconds(1500))};
  EXPECT_EQ(link.session.post(group, link.now), PostResult::not_armed);
  const Ticket ticket = link.session.send(group, 1s, link.now);
  link.pass(1ms);
  EXPECT_EQ(outcome(ticket), Outcome::not_armed);
  EXPECT_EQ(link.count('O'), 0U);
}

TEST_F(SessionArming, ClosesRelay1AndIsArmedWhenTheBoardReportsItClosed) {
  const Ticket ticket = arm();
  EXPECT_EQ(link.last('R').command, "R:1,On");
  EXPECT_EQ(link.count('E'), 0U) << "no cause has to be cleared";
  EXPECT_EQ(link.results.count(ticket), 0U);
  EXPECT_EQ(post(), PostResult::not_armed) << "the board must confirm relay 1 first";
  execute('R', SafeReason::none, true);
  EXPECT_EQ(outcome(ticket), Outcome::confirmed);
  EXPECT_EQ(link.session.disarmed_by(), DisarmCause::none);
  EXPECT_EQ(link.arming, std::vector<DisarmCause>{DisarmCause::none});
  EXPECT_EQ(post(), PostResult::sent);
}

TEST_F(SessionArming, SelectsTheFieldThatReportsRelay1) {
  link.session.send(Command::fields("ENC1"), 1s, link.now);
  EXPECT_EQ(link.last('F').command, "F:ENC1,SAFE,CMD,RELAYS");
}

TEST_F(SessionArming, EveryCauseButTheLinkDisarms) {
  const std::pair<SafeReason, DisarmCause> causes[] = {
      {SafeReason::stop, DisarmCause::stop},
      {SafeReason::handle, DisarmCause::handle},
      {SafeReason::proximity, DisarmCause::proximity},
      {SafeReason::watchdog, DisarmCause::watchdog},
      {SafeReason::fault, DisarmCause::fault}};
  for (const auto& [reason, cause] : causes) {
    armed();
    link.heartbeat(reason);
    EXPECT_EQ(link.session.disarmed_by(), cause);
    EXPECT_EQ(post(), PostResult::not_armed);
    // The cause ends by itself, or by another program's E:CLEAR.
    state(SafeReason::none, cmd, false);
    EXPECT_EQ(post(), PostResult::not_armed) << "no motor may start";
    EXPECT_EQ(link.session.disarmed_by(), cause)
        << "the first cause must be reported, not a later one";
  }
}

TEST_F(SessionArming, StaysArmedAfterAnOutageOnlyIfTheBoardRestoresItsOutputs) {
  armed();
  outage(true);
  EXPECT_EQ(post(), PostResult::sent);
  outage(false);  // recovery=rearm, or another host had control
  EXPECT_EQ(link.session.disarmed_by(), DisarmCause::link);
  EXPECT_EQ(post(), PostResult::not_armed);
}

TEST_F(SessionArming, ARestartOfTheBoardDisarms) {
  armed();
  link.reboot();
  link.boot_heartbeat();
  link.heartbeat();
  EXPECT_EQ(link.session.disarmed_by(), DisarmCause::restart);
}

TEST_F(SessionArming, AnOpenRelay1DisarmsEvenIfItsCauseWasMissed) {
  armed();
  state(SafeReason::none, cmd, true);
  EXPECT_EQ(post(), PostResult::sent);
  state(SafeReason::none, cmd, false);
  EXPECT_EQ(link.session.disarmed_by(), DisarmCause::supply);
}

TEST_F(SessionArming, AStopOfThisHostDisarmsAtOnce) {
  armed();
  link.session.send(Command::stop(), 1s, link.now);
  EXPECT_EQ(link.session.disarmed_by(), DisarmCause::stop);
  EXPECT_EQ(post(), PostResult::not_armed);
}

TEST_F(SessionArming, ClearsAStopAndEachHiddenCauseOnce) {
  link.heartbeat(SafeReason::stop);
  const Ticket ticket = arm();
  EXPECT_EQ(link.count('E'), 1U);
  execute('E', SafeReason::fault);
  EXPECT_EQ(link.count('E'), 2U) << "the stop had hidden a fault";
  execute('E', SafeReason::watchdog);
  EXPECT_EQ(link.count('E'), 3U);
  EXPECT_EQ(link.count('R'), 0U) << "all causes must be cleared first";
  execute('E');
  execute('R', SafeReason::none, true);
  EXPECT_EQ(outcome(ticket), Outcome::confirmed);
}

struct ArmingMeanwhile : SessionArming, testing::WithParamInterface<SafeReason> {};
INSTANTIATE_TEST_SUITE_P(Causes, ArmingMeanwhile,
                         testing::Values(SafeReason::fault, SafeReason::stop));

TEST_P(ArmingMeanwhile, DoesNotClearAStopPressedDuringArming) {
  link.heartbeat(GetParam());
  const Ticket ticket = arm();
  EXPECT_EQ(link.count('E'), 1U);
  execute('E', SafeReason::stop);
  EXPECT_EQ(outcome(ticket), Outcome::not_armed);
  EXPECT_EQ(result(ticket).disarmed, DisarmCause::stop);
  link.pass(2s);
  EXPECT_EQ(link.count('E'), 1U);
  EXPECT_EQ(link.count('R'), 0U);
}

TEST_F(SessionArming, AReleasedHandleEndsAnArmWhoseRelayIsNotConfirmed) {
  const Ticket ticket = arm();
  ASSERT_EQ(link.count('R'), 1U);  // lost
  link.heartbeat(SafeReason::handle);
  link.pass(1ms);
  EXPECT_EQ(outcome(ticket), Outcome::not_armed);
  EXPECT_EQ(link.session.disarmed_by(), DisarmCause::handle);
  link.heartbeat();  // the handle is held again
  link.pass(500ms);
  EXPECT_EQ(link.count('R'), 1U);
}

TEST_F(SessionArming, DoesNotRepeatAnOutputCommandAfterItIsDisarmed) {
  armed();
  const Ticket ticket = link.session.send(turn_motor, 3s, link.now);
  link.pass(1ms);
  ASSERT_EQ(link.count('O'), 1U);  // lost
  link.heartbeat(SafeReason::handle);
  link.heartbeat();
  link.pass(500ms);
  EXPECT_EQ(link.count('O'), 1U);
  EXPECT_EQ(outcome(ticket), Outcome::cancelled);
}

TEST_F(SessionArming, StillRepeatsACommandThatSwitchesAnOutputOff) {
  armed();
  link.session.send(Command::servo(1, Microseconds(0)), 3s, link.now);
  link.pass(1ms);
  link.heartbeat(SafeReason::handle);
  link.pass(500ms);
  EXPECT_GT(link.count('S'), 2U);
}

TEST_F(SessionArming, DoesNotWaitForALaterEClear) {
  link.heartbeat(SafeReason::stop);
  const Ticket ticket = link.session.arm(1s, link.now);
  const Ticket clear = link.session.send(Command::clear(), 1s, link.now);
  link.pass(1ms);
  ASSERT_EQ(link.count('E'), 1U) << "arm() must clear the cause";
  execute('E');
  execute('R', SafeReason::none, true);
  EXPECT_EQ(outcome(ticket), Outcome::confirmed);
  link.pass(1ms);
  execute('E', SafeReason::none, true);
  EXPECT_EQ(outcome(clear), Outcome::confirmed);
}

TEST_F(SessionArming, ARetryAfterARefusedArmSendsANewClear) {
  link.heartbeat(SafeReason::stop);
  const Ticket first = arm();
  link.nack(link.last('E').pnum, "CHANNEL");
  ASSERT_EQ(outcome(first), Outcome::refused);
  EXPECT_EQ(result(first).code, Refusal::channel);
  EXPECT_EQ(post(), PostResult::not_armed);
  const Ticket second = arm();
  EXPECT_EQ(link.count('E'), 2U);
  execute('E');
  execute('R', SafeReason::none, true);
  EXPECT_EQ(outcome(second), Outcome::confirmed);
}

TEST_F(SessionArming, AnOvertakenStateDoesNotProveThatRelay1IsOpen) {
  armed();
  link.pass(20ms);
  const std::string earlier = link.stamp();
  link.pass(5ms);
  link.heartbeat();
  link.raw(with_crc("RELAYS:0;SAFE:1;CMD:" + std::to_string(cmd) + ";" + earlier));
  EXPECT_EQ(link.session.disarmed_by(), DisarmCause::none);
}

// --- causes that may be older than the session

struct EarlierCause : MustArm {
  // A program starts while its board is safe for this reason. The board obeys the program.
  void begin(SafeReason reason) {
    link.heartbeat();  // this delayed heartbeat is older than the cause, so it proves nothing
    link.heartbeat(reason);
    link.pass(10ms);
    says(reason);
    ASSERT_TRUE(link.session.in_control(link.now));
    link.sent.clear();
  }
  void says(SafeReason reason) {
    if (link.count('F') != 0) cmd = link.last('F').pnum;
    state(reason, cmd, false);
  }
  CommandResult arm() { return link.results[MustArm::arm()]; }
};

TEST_F(EarlierCause, IsNotClearedByArming) {
  begin(SafeReason::stop);
  const CommandResult result = arm();
  EXPECT_EQ(result.outcome, Outcome::not_armed);
  EXPECT_EQ(result.disarmed, DisarmCause::earlier_stop);
  const Problem problem = explain("arm()", result, link.session.link());
  EXPECT_EQ(problem.reason, "not armed: an emergency stop came before this program began");
  EXPECT_EQ(
      problem.fix,
      "clear it on purpose: r4 send URL E:CLEAR, or board.send(\"E:CLEAR\"), then call arm()");
  EXPECT_EQ(link.session.disarmed_by(), DisarmCause::earlier_stop);
  link.pass(2s);
  EXPECT_EQ(link.count('E') + link.count('R'), 0U);
}

TEST_F(EarlierCause, CanBeAWatchdogOrAFault) {
  begin(SafeReason::fault);
  EXPECT_EQ(arm().disarmed, DisarmCause::earlier_fault);
  says(SafeReason::watchdog);
  EXPECT_EQ(arm().disarmed, DisarmCause::earlier_watchdog);
  EXPECT_EQ(link.count('E') + link.count('R'), 0U);
}

TEST_F(EarlierCause, CanBeAFaultWithWhichTheBoardBegins) {
  begin(SafeReason::none);
  link.reboot();
  link.boot_heartbeat();
  begin(SafeReason::fault);
  EXPECT_EQ(arm().disarmed, DisarmCause::earlier_fault);
  EXPECT_EQ(link.count('E') + link.count('R'), 0U);
}

TEST_F(EarlierCause, ArmWaitsForAClearUnderWay) {
  begin(SafeReason::stop);
  link.session.send(Command::clear(), 1s, link.now);
  const Ticket ticket = link.session.arm(1s, link.now);
  link.pass(1ms);
  EXPECT_EQ(link.results.count(ticket), 0U) << "the command must not have failed";
  cmd = link.last('E').pnum;
  says(SafeReason::none);
  EXPECT_EQ(link.count('R'), 1U);
}

TEST_F(EarlierCause, StaysEarlierIfTheStopIsPressedAgain) {
  begin(SafeReason::stop);
  link.stopped(1, 7);
  link.stopped(2, 8);
  EXPECT_EQ(arm().disarmed, DisarmCause::earlier_stop);
}

TEST_F(EarlierCause, MayBeHiddenByALaterStop) {
  begin(SafeReason::fault);
  says(SafeReason::stop);  // a stop after the start
  const Ticket ticket = link.session.arm(1s, link.now);
  link.pass(1ms);
  ASSERT_EQ(link.count('E'), 1U) << "the stop came while the program was running";
  cmd = link.last('E').pnum;
  says(SafeReason::fault);
  EXPECT_EQ(link.results[ticket].disarmed, DisarmCause::earlier_fault);
  EXPECT_EQ(link.count('E'), 1U);
}

TEST_F(EarlierCause, DoesNotIncludeAStopWhileTheHandleIsReleased) {
  begin(SafeReason::handle);
  says(SafeReason::stop);
  arm();
  EXPECT_EQ(link.count('E'), 1U);
}

TEST_F(EarlierCause, IncludesEveryCauseFoundAfterASleep) {
  begin(SafeReason::none);
  link.session.on_sleep(link.now);
  link.heartbeat(SafeReason::stop);
  link.pass(300ms);  // until the session selects its fields again
  says(SafeReason::stop);
  EXPECT_EQ(arm().disarmed, DisarmCause::earlier_stop);
}

TEST_F(SessionArming, FailsAtOnceForACauseThatCannotBeCleared) {
  Ticket ticket = 0;
  for (const auto& [reason, cause] : {std::pair(SafeReason::proximity, DisarmCause::proximity),
                                      std::pair(SafeReason::handle, DisarmCause::handle)}) {
    link.heartbeat(reason);
    ticket = arm();
    EXPECT_EQ(outcome(ticket), Outcome::not_armed);
    EXPECT_EQ(result(ticket).disarmed, cause);
    EXPECT_LT(result(ticket).elapsed, 2ms);
  }
  EXPECT_EQ(link.count('R'), 0U);
  const Problem problem = explain("arm()", result(ticket), link.session.link());
  EXPECT_EQ(problem.reason, "not armed: the dead-man's handle was released");
  EXPECT_EQ(problem.fix, "hold the handle, then call arm()");
}

TEST_F(SessionArming, SendsNothingAfterATimeoutACancellationOrAStop) {
  const auto ends_as = [&](Ticket ticket, Outcome wanted) {
    EXPECT_EQ(outcome(ticket), wanted);
    EXPECT_GE(link.count('R'), 1U);
    link.sent.clear();
    link.heartbeat();
    link.pass(500ms);
    link.heartbeat();
    EXPECT_EQ(link.count('R'), 0U) << "an abandoned call must not be repeated";
  };
  const Ticket late = arm();
  link.pass(500ms);
  link.heartbeat();
  link.pass(500ms);
  ends_as(late, Outcome::timed_out);
  const Ticket cancelled = arm();
  link.session.cancel(cancelled, link.now);
  ends_as(cancelled, Outcome::cancelled);
  const Ticket stopped = arm();
  link.session.send(Command::stop(), 1s, link.now);
  ends_as(stopped, Outcome::cancelled);
  EXPECT_EQ(link.session.disarmed_by(), DisarmCause::stop);
}

TEST_F(SessionArming, ArmEndsIfItWasCalledBeforeAnOwnStopIsConfirmed) {
  link.session.send(Command::stop(), 1s, link.now);
  const std::uint32_t stop = link.last('E').pnum;
  Ticket ticket = arm();
  EXPECT_EQ(link.count('R'), 0U);
  link.stopped(stop, 7);
  EXPECT_EQ(outcome(ticket), Outcome::not_armed);
  ticket = arm();
  EXPECT_EQ(link.last('E').command, "E:CLEAR,7");
  execute('E');
  execute('R', SafeReason::none, true);
  EXPECT_EQ(outcome(ticket), Outcome::confirmed);
}

TEST_F(SessionArming, AStopOfAnotherHostDuringArmEndsIt) {
  link.stopped(1, 7);
  state(SafeReason::stop, cmd, false);
  const Ticket ticket = arm();
  EXPECT_EQ(link.last('E').command, "E:CLEAR,7");
  link.stopped(2, 8);
  EXPECT_EQ(outcome(ticket), Outcome::not_armed);
  link.sent.clear();
  link.pass(500ms);
  EXPECT_EQ(link.count('E') + link.count('R'), 0U);
}

TEST_F(SessionArming, OutputCommandsWaitForAnEarlierArm) {
  const Ticket ticket = link.session.arm(1s, link.now);
  const Ticket behind = link.session.send(turn_motor, 1s, link.now);
  link.pass(1ms);
  EXPECT_EQ(link.count('O'), 0U);
  execute('R', SafeReason::none, true);
  EXPECT_EQ(outcome(ticket), Outcome::confirmed);
  EXPECT_EQ(link.count('O'), 1U);
  execute('O', SafeReason::none, true);
  EXPECT_EQ(outcome(behind), Outcome::confirmed);
  EXPECT_EQ(outcome(arm()), Outcome::confirmed) << "the session is armed already";
  EXPECT_EQ(link.count('R'), 1U);
}

TEST_F(SessionArming, OutputCommandsAfterAFailedArmAreRefused) {
  link.heartbeat(SafeReason::handle);
  link.session.arm(1s, link.now);
  const Ticket behind = link.session.send(turn_motor, 1s, link.now);
  link.pass(1ms);
  EXPECT_EQ(outcome(behind), Outcome::not_armed);
  EXPECT_EQ(link.results[behind].disarmed, DisarmCause::handle);
}

TEST_F(SessionArming, CanBeTurnedOff) {
  ConnectedLink free;
  EXPECT_EQ(free.session.post(turn_motor, free.now), PostResult::sent);
  free.heartbeat(SafeReason::stop);
  free.heartbeat();
  EXPECT_EQ(free.session.post(turn_motor, free.now), PostResult::sent)
      << "the paper's clients command without arming";
  const Ticket ticket = free.session.arm(1s, free.now);
  free.pass(1ms);
  free.executed(free.last('R').pnum);
  EXPECT_EQ(free.results[ticket].outcome, Outcome::confirmed)
      << "arm() works without a duty to arm";
}

// --- posts that the board refuses

TEST_F(SessionArming, ReportsOnceAPostThatTheBoardRefuses) {
  armed();
  ASSERT_EQ(post(), PostResult::sent);
  const std::uint32_t pnum = link.last('O').pnum;
  const std::uint64_t before = link.session.statistics(link.now).refused;
  link.nack(pnum, "SAFE");
  link.nack(pnum, "SAFE");
  ASSERT_EQ(link.refused.size(), 1U);
  EXPECT_EQ(link.refused[0].command.kind, CommandKind::osmc);
  EXPECT_EQ(link.refused[0].command.value, 358);
  EXPECT_EQ(link.refused[0].code, Refusal::safe);
  EXPECT_EQ(link.session.statistics(link.now).refused, before + 1);
  post();
  link.nack(link.last('O').pnum, "DUPLICATE");  // the board has executed the post
  EXPECT_EQ(link.refused.size(), 1U);
}

TEST_F(SessionArming, IgnoresARefusalOfAPostFromBeforeAnOutage) {
  armed();
  post();
  const std::uint32_t pnum = link.last('O').pnum;
  outage(true);
  link.session_pnum = link.last('H').pnum;  // the board has begun another session
  link.nack(pnum, "STALE");
  EXPECT_TRUE(link.refused.empty());
}

}  // namespace
}  // namespace r4::test
