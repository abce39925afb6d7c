// SPDX-License-Identifier: GPL-3.0-or-later
// The watchdog of the application, and the texts of the link's status.
#include <gtest/gtest.h>

#include "r4link/link.hpp"
#include "scripted_link.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

using SessionLink = ConnectedSession;
using SessionWatchdog = ConnectedSession;
using SessionHold = ConnectedSession;

TEST_F(SessionWatchdog, HoldsCommandsOfAProgramThatDoesNotFeed) {
  link.session.watchdog(300ms, link.now);
  const Time begin = link.now;
  // A call that waits for a board that does not answer.
  const Ticket lost = link.session.send(turn_motor, 1s, link.now);
  link.pass(400ms);
  const std::size_t sent = link.count('O');
  EXPECT_GT(sent, 3U);
  EXPECT_LE(link.last('O').at - begin, 310ms) << "commands must stop when the program hangs";
  EXPECT_TRUE(link.session.link().gated());
  EXPECT_FALSE(link.session.in_control(link.now));
  const Ticket late = link.session.send(turn_motor, 5s, link.now);
  link.pass(300ms);
  EXPECT_EQ(link.count('O'), sent);
  EXPECT_EQ(link.results.count(lost), 0U);

  link.session.send(Command::stop(), 1s, link.now);
  link.pass(100ms);
  EXPECT_GE(link.count('E'), 4U) << "a stop must always be sent";
  EXPECT_EQ(link.results.at(late).outcome, Outcome::cancelled);
}

TEST_F(SessionHold, HoldsHeartbeatsAndCommandsButSendsStops) {
  link.session.hold(true, link.now);
  EXPECT_EQ(link.links.back().cause(), LinkCause::callback) << "on_link must report it";
  EXPECT_FALSE(link.session.in_control(link.now));
  EXPECT_EQ(link.session.post(turn_motor, link.now), PostResult::no_link);
  const Ticket waits = link.session.send(turn_motor, 5s, link.now);
  const Ticket late = link.session.send(Command::servo(1, Microseconds(1500)), 300ms, link.now);
  for (int i = 0; i < 4; ++i) {
    link.heartbeat();
    link.pass(100ms);
  }
  EXPECT_EQ(link.count('H'), 0U);
  EXPECT_EQ(link.count('O') + link.count('S'), 0U);
  EXPECT_EQ(link.results.at(late).outcome, Outcome::timed_out);

  link.session.hold(false, link.now);
  EXPECT_FALSE(link.session.link().gated());
  link.pass(1ms);
  EXPECT_EQ(link.count('H'), 1U);
  EXPECT_EQ(link.count('O'), 1U) << "the command whose caller still waits must be sent";
  EXPECT_EQ(link.count('S'), 0U);
  EXPECT_EQ(link.results.count(waits), 0U);

  link.session.hold(true, link.now);
  link.session.send(Command::stop(), 1s, link.now);
  link.pass(100ms);
  EXPECT_GE(link.count('E'), 4U) << "a stop must always be sent";
}

TEST_F(SessionLink, SendsNoCommandAfterItsDeadline) {
  link.place_taken = true;
  link.session.post(Command::servo(1, Microseconds(1500)), link.now);
  link.session.send(turn_motor, 100ms, link.now);  // waits until the place is free
  link.place_taken = false;
  link.now += 750ms;                     // the loop was delayed
  link.executed(link.session_pnum + 1);  // confirms the choice of fields
  EXPECT_TRUE(link.session.link().in_control);
  EXPECT_EQ(link.count('O'), 0U);
}

TEST_F(NewSession, ReportsWhenTheBoardTakesCommands) {
  link.heartbeat();
  link.pass(10ms);
  EXPECT_EQ(link.session.link().state, HostLinkState::active);
  EXPECT_FALSE(link.session.link().in_control);
  EXPECT_TRUE(contains(explain("board", link.session.link()).reason, "not confirmed a command"));
  link.executed(link.last('F').pnum);
  EXPECT_TRUE(link.session.link().in_control);
  EXPECT_TRUE(link.links.back().in_control) << "on_link must report it";
  link.executed(1);
  link.heartbeat();
  EXPECT_EQ(link.links.size(), 2U) << "each change must be reported once";
  EXPECT_EQ(explain("board", link.session.link()).reason,
            "the board is active and accepts our commands");
}

TEST_F(SessionLink, ReportsLateFramesOnlyWhileTheBoardIsHeard) {
  link.frames = TransportTrouble::late_frames;
  link.pass(1ms);
  EXPECT_EQ(link.session.link().causes, LinkCauses{LinkCause::late_frames});
  link.pass(1100ms);
  EXPECT_EQ(link.session.link().state, HostLinkState::lost);
  EXPECT_TRUE(link.session.link().causes.empty());
  EXPECT_EQ(explain("board", link.session.link()).reason, "the board is silent");
}

TEST_F(NewSession, ReportsForeignFramesBeforeTheBoardIsHeard) {
  link.frames = TransportTrouble::foreign_frames;
  link.pass(1ms);
  EXPECT_EQ(link.session.link().state, HostLinkState::connecting);
  EXPECT_EQ(link.session.link().causes, LinkCauses{LinkCause::foreign_frames});
}

TEST_F(SessionLink, ReportsTheChipThatFailed) {
  link.state("AIN24:24.28;SAFE:6;FAULT:97,1;");
  EXPECT_EQ(link.session.link().chip, (ChipFault{97, ChipTrouble::no_acknowledge}));
  const Problem problem = explain("board", link.session.link());
  EXPECT_TRUE(contains(problem.reason, "MCP4728"));
  EXPECT_TRUE(contains(problem.reason, "no acknowledge"));
  link.state("AIN24:24.28;SAFE:0;");
  EXPECT_FALSE(link.session.link().chip.any());
}

TEST(Explain, AdvisesToCutThePowerForAnUnconfirmedStop) {
  LinkStatus link;
  link.causes = {LinkCause::watchdog, LinkCause::busy, LinkCause::key_needed};
  const CommandResult unheard{Outcome::timed_out, Refusal::none, 1s};
  const Problem silent = explain(Command::stop(), unheard, link);
  EXPECT_TRUE(contains(silent.reason, "not confirmed within 1000 ms: nothing was received"));
  EXPECT_TRUE(silent.fix.starts_with("CUT THE POWER")) << silent.fix;
  EXPECT_EQ(silent.text().find("watchdog"), std::string::npos) << silent.text();
  link.state = HostLinkState::active;
  const Problem drives = explain(Command::stop(), unheard, link);
  EXPECT_TRUE(contains(drives.reason, "reports no stop"));
  EXPECT_TRUE(drives.fix.starts_with("CUT THE POWER"));
}

}  // namespace
}  // namespace r4::test
