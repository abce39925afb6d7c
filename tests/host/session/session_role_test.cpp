// SPDX-License-Identifier: GPL-3.0-or-later
// A session that takes control, and releases it.
#include <gtest/gtest.h>

#include "host/session/session.hpp"
#include "scripted_link.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

struct SessionRole : NewSession {
  SessionRole() : NewSession(ScriptedLink::must_arm(), BoardRole::watch) {}
  void change(BoardRole role) {
    link.session.change_role(role, link.now);
    link.session.on_transport(0, true, link.now);
    link.pass(1ms);
  }
  void take() {
    change(BoardRole::control);
    link.connect();
  }
};

TEST_F(SessionRole, TakingControlBeginsANewDisarmedSession) {
  link.state("AIN24:24.28;SAFE:1;");
  link.heartbeat(SafeReason::link);
  link.sent.clear();
  change(BoardRole::control);
  ASSERT_EQ(link.count('H'), 1U) << "the heartbeat must be sent at once";
  EXPECT_EQ(link.last('H').t, 0U) << "the board has sent this session no T to echo";
  EXPECT_NE(link.host_session, no_session);
  EXPECT_FALSE(link.session.in_control(link.now));
  link.connect();
  EXPECT_EQ(link.session.disarmed_by(), DisarmCause::not_yet);
  EXPECT_EQ(link.session.post(turn_motor, link.now), PostResult::not_armed);
  link.pass(2s);
  EXPECT_EQ(link.count('W'), 0U);
  EXPECT_EQ(link.session.state().raw.analog_cv[0], 2428) << "known values must stay";
  EXPECT_EQ(link.restarts, 0);
}

TEST_F(SessionRole, ReleasingControlWatchesAfterTheConfirmedFarewell) {
  take();
  const Ticket ticket = link.session.leave(100ms, link.now, Outcome::cancelled);
  EXPECT_TRUE(link.session.leaving());
  EXPECT_EQ(link.last('E').command, "E:LEAVE");
  link.pass(50ms);
  EXPECT_GT(link.count('E'), 1U);
  EXPECT_EQ(link.count('H'), 0U);
  link.heartbeat(SafeReason::link);
  EXPECT_EQ(outcome(ticket), Outcome::confirmed);
  link.sent.clear();
  change(BoardRole::watch);
  EXPECT_EQ(link.count('W'), 1U) << "the W must be sent at once";
  EXPECT_EQ(link.host_session, no_session);
  link.state("AIN24:24.28;SAFE:1;");
  link.pass(2s);
  EXPECT_EQ(link.count('H') + link.count('E') + link.count('F'), 0U);
  EXPECT_EQ(problem_of([&] { link.session.send(turn_motor, 1s, link.now); }).kind,
            ErrorKind::usage);
}

TEST_F(SessionRole, ReleasingControlDisarmsAndTheNextControlIsANewSession) {
  take();
  const SessionId first = link.host_session;
  const Ticket armed = link.session.arm(1s, link.now);
  link.pass(1ms);
  const std::uint32_t of_first = link.last('R').pnum;
  link.state("SAFE:0;RELAYS:1;CMD:" + std::to_string(of_first) + ";");
  ASSERT_EQ(outcome(armed), Outcome::confirmed);
  link.session.leave(100ms, link.now, Outcome::cancelled);
  EXPECT_EQ(link.session.disarmed_by(), DisarmCause::not_yet);
  EXPECT_EQ(link.arming, (std::vector<DisarmCause>{DisarmCause::none, DisarmCause::not_yet}));
  link.heartbeat(SafeReason::link);
  change(BoardRole::watch);
  change(BoardRole::control);
  EXPECT_NE(link.host_session, first);
  link.heartbeat();
  link.pass(10ms);
  link.executed(of_first);
  EXPECT_FALSE(link.session.in_control(link.now)) << "the number is of the earlier session";
  link.executed(link.last('F').pnum);
  EXPECT_TRUE(link.session.in_control(link.now));
  EXPECT_EQ(link.session.disarmed_by(), DisarmCause::not_yet)
      << "relay 1 is closed, but the session was not armed";
  EXPECT_EQ(link.session.post(turn_motor, link.now), PostResult::not_armed);
}

// The motor must not run for a command whose caller has given up.
TEST_F(SessionRole, AChangeOfRoleCancelsEarlierCommands) {
  change(BoardRole::control);
  const Ticket early = link.session.send(Command::fields("ENC1"), 60s, link.now);
  const Ticket arms = link.session.arm(60s, link.now);
  const Ticket behind = link.session.send(turn_motor, 60s, link.now);
  EXPECT_EQ(link.session.leave(100ms, link.now, Outcome::cancelled), 0U) << "there is no link yet";
  for (const Ticket each : {early, arms, behind}) EXPECT_EQ(outcome(each), Outcome::cancelled);
  const Ticket late = link.session.send(Command::fields("ENC1"), 60s, link.now);
  change(BoardRole::watch);
  EXPECT_EQ(outcome(late), Outcome::cancelled)
      << "the command came while control was being released";
  const SessionId earlier = link.host_session;
  link.sent.clear();
  take();
  EXPECT_NE(link.host_session, earlier);
  link.pass(1s);
  EXPECT_EQ(link.count('O') + link.count('F') + link.count('R'), 0U);
}

TEST_F(SessionRole, AStopContinuesOverEveryChangeAndAfterLeaving) {
  link.state("SAFE:0;");
  const Ticket ticket = link.session.send(Command::stop(), 10s, link.now);
  const std::uint32_t pnum = link.last('E').pnum;
  for (const BoardRole role : {BoardRole::control, BoardRole::watch}) {
    change(role);
    link.sent.clear();
    link.pass(100ms);
    EXPECT_GE(link.count('E'), 4U);
    EXPECT_EQ(link.last('E').pnum, pnum);
    EXPECT_EQ(link.last('E').priority, Priority::stop);
  }
  link.session.leave(100ms, link.now);
  link.sent.clear();
  link.pass(100ms);
  EXPECT_GE(link.count('E'), 4U);
  link.stopped(pnum);
  EXPECT_EQ(outcome(ticket), Outcome::confirmed);
}

TEST_F(SessionRole, HeartbeatsStayHeldOverAChangeUntilHoldAndWatchdogEnd) {
  link.session.watchdog(50ms, link.now);
  link.session.hold(true, link.now);
  link.pass(200ms);
  EXPECT_FALSE(link.session.link().gated()) << "a watcher sends no heartbeats";
  change(BoardRole::control);
  EXPECT_EQ(link.session.link().causes, (LinkCauses{LinkCause::watchdog, LinkCause::callback}));
  link.session.feed(link.now);
  EXPECT_EQ(link.session.link().cause(), LinkCause::callback);
  link.pass(500ms);
  link.session.hold(false, link.now);
  link.pass(500ms);
  EXPECT_EQ(link.count('H'), 0U);
  link.session.feed(link.now);
  link.pass(1ms);
  EXPECT_EQ(link.count('H'), 1U);
}

}  // namespace
}  // namespace r4::test
