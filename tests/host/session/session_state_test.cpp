// SPDX-License-Identifier: GPL-3.0-or-later
// The state that a session stores of its board, the age of that state, and how a restart of the
// board clears it.
#include <gtest/gtest.h>

#include "scripted_link.hpp"
#include "tests/support/datagrams.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;
using Clock = ReceivedState::Clock;
using SessionState = ConnectedSession;

Clock::duration age(const ScriptedLink& link) {
  return link.session.state().age(Clock::time_point(link.now));
}

TEST_F(NewSession, ReportsTheAgeOfTheStateEvenWhileTheLinkIsLost) {
  EXPECT_FALSE(link.session.state().any());
  EXPECT_EQ(age(link), Clock::duration::max());
  link.connect();
  link.state("AIN24:24.28;SAFE:0;CMD:1;");
  EXPECT_EQ(link.session.state().received, Clock::time_point(link.now));
  EXPECT_EQ(age(link), 0s);
  EXPECT_EQ(link.states.back().received, Clock::time_point(link.now))
      << "on_state must get the time, too";
  link.pass(5s);
  EXPECT_EQ(link.session.link().state, HostLinkState::lost);
  EXPECT_EQ(age(link), 5s);
}

TEST_F(SessionState, StaysOverAnOutageAndTakesTheSafeReasonFromHeartbeats) {
  link.state("ENC1:7;SAFE:0;CMD:1;");
  const auto received = link.session.state().received;
  link.pass(60s);
  link.heartbeat(SafeReason::link);
  EXPECT_EQ(link.session.link(),
            (LinkStatus{.state = HostLinkState::safe, .reason = SafeReason::link, .carrying = 1}));
  EXPECT_EQ(link.restarts, 0);
  EXPECT_EQ(link.session.state().safe, SafeReason::link);
  EXPECT_EQ(link.session.state().encoder(1), 7);
  EXPECT_EQ(link.session.state().received, received) << "a heartbeat is not a state";
  link.heartbeat();
  EXPECT_EQ(link.session.state().safe, SafeReason::none);
}

TEST_F(SessionState, NamesTheFieldsReportedSinceTheBoardStarted) {
  const auto reported = [this](StateField field) {
    return link.session.state().reported.has(field);
  };
  link.state("ENC1:7;SAFE:2;CMD:1;");
  link.state("OSMC1:358,1;");  // another part of a state that needs several datagrams
  EXPECT_EQ(link.session.link().reason, SafeReason::none) << "the newest state has no SAFE";
  EXPECT_TRUE(reported(StateField::enc1) && reported(StateField::osmc1));
  EXPECT_FALSE(link.session.state().present.has(StateField::enc1));
  EXPECT_FALSE(reported(StateField::enc2));
  link.pass(300ms);
  link.reboot();
  link.state("AIN24:24.28;");
  EXPECT_TRUE(reported(StateField::ain24));
  EXPECT_FALSE(reported(StateField::enc1));
  link.heartbeat(SafeReason::link);
  EXPECT_TRUE(reported(StateField::safe)) << "heartbeats report the safe reason, too";
}

TEST_F(SessionState, ForgetsAChipFaultWhenTheBoardStopsReportingIt) {
  link.state("SAFE:6;FAULT:97,1;CMD:1;");
  EXPECT_EQ(link.session.state().fault.address, 97);
  link.state("SAFE:2;FAULT:97,1;CMD:1;");
  EXPECT_TRUE(link.session.state().fault.any())
      << "a more serious cause hides the reason, not the faulty chip";
  link.state("SAFE:0;CMD:1;");
  EXPECT_FALSE(link.session.state().fault.any());
  link.state("SAFE:5;CMD:1;");
  EXPECT_FALSE(link.session.state().fault.any()) << "a watchdog reset is not a fault of a chip";
}

// A heartbeat shows the restart or, if the earlier datagrams were lost, a state.
TEST_F(SessionState, IsClearedByARestartOfTheBoard) {
  for (const bool by_heartbeat : {true, false}) {
    ConnectedLink each;
    each.state("OSMC1:358,1;ENC1:7;SAFE:6;FAULT:97,1;CMD:1;");
    each.pass(by_heartbeat ? 300ms : 0ms);
    each.reboot();
    if (by_heartbeat) {
      each.boot_heartbeat();
      each.heartbeat();
      EXPECT_EQ(each.restarts, 1);
      EXPECT_FALSE(each.session.state().any());
    }
    each.state(by_heartbeat ? "ENC2:5;" : "ENC2:5;SAFE:3;");
    EXPECT_EQ(each.restarts, 1) << by_heartbeat;
    EXPECT_EQ(each.session.packets().lost, 0U) << "numbers that begin anew are not a loss";
    const ReceivedState& state = each.states.back();
    EXPECT_EQ(state.encoder(2), 5) << by_heartbeat;
    EXPECT_EQ(state.encoder(1), 0) << by_heartbeat;
    EXPECT_EQ(state.osmc(1).pwm, 0) << by_heartbeat;
    EXPECT_FALSE(state.fault.any()) << by_heartbeat;
    EXPECT_EQ(state.safe, by_heartbeat ? SafeReason::none : SafeReason::handle);
  }
}

TEST_F(SessionState, KeepsTheSafeReasonOfAHeartbeatThatOvertookIt) {
  for (const int later_ms : {0, 5}) {
    ConnectedLink each;
    each.pass(20ms);
    const std::string earlier = each.stamp();
    each.pass(std::chrono::milliseconds(later_ms));
    each.heartbeat(SafeReason::stop);
    each.raw(with_crc("AIN24:24.28;SAFE:0;" + earlier));
    EXPECT_EQ(each.states.back().raw.analog_cv[0], 2428) << "this is the newest state";
    EXPECT_EQ(each.states.back().safe, SafeReason::stop) << later_ms;
    EXPECT_EQ(each.session.link().reason, SafeReason::stop) << later_ms;
  }
}

}  // namespace
}  // namespace r4::test
