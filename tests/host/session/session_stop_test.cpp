// SPDX-License-Identifier: GPL-3.0-or-later
// A stop that the board does not confirm, with the real board: after the outage the motor must not
// turn again, although the setting `recovery` is `last`.
#include <gtest/gtest.h>

#include <string>

#include "r4link/link.hpp"
#include "robot_on_paths.hpp"

namespace r4::test {
namespace {

using Cables = RobotOnPaths::Cables;

class FailedStop : public ::testing::TestWithParam<Cables> {
 protected:
  static bool drives(RobotOnPaths& of) { return of.board(0).outputs().osmc[0].pwm != 0; }
  static void cut_to_board(RobotOnPaths& of, bool is_cut) {
    for (auto& cable : of.cables) cable.cut_to_board = is_cut;
  }
  static void cut_to_host(RobotOnPaths& of, bool is_cut) {
    for (auto& cable : of.cables) cable.cut_to_host = is_cut;
  }
  static void cut(RobotOnPaths& of, bool is_cut) {
    cut_to_board(of, is_cut);
    cut_to_host(of, is_cut);
  }
  static void lose(RobotOnPaths& of, const std::string& what) {
    for (auto& cable : of.cables) cable.loses = what;
  }
  // The call of the stop fails after RobotOnPaths::timeout, which is 1 s.
  static void fail_to_stop(RobotOnPaths& of) {
    ASSERT_EQ(of.finish(of.send(Command::stop())).outcome, Outcome::timed_out);
  }
  static void expect_rest(RobotOnPaths& of) {
    for (int ms = 0; ms < 5000; ++ms) {
      of.run(1);
      ASSERT_FALSE(drives(of)) << ms << " ms later";
    }
  }
  // The board obeys the host again. An E:CLEAR alone moves nothing.
  static void expect_control(RobotOnPaths& of) {
    if (of.board(0).reason() == SafeReason::stop) {
      ASSERT_EQ(of.finish(of.send(Command::clear())).outcome, Outcome::confirmed);
      of.run(200);
      ASSERT_FALSE(drives(of));
    }
    EXPECT_EQ(of.drive(50).outcome, Outcome::confirmed);
  }
};

TEST_P(FailedStop, IsNotFollowedByTheEarlierOutputs) {
  for (const std::uint32_t outage_ms : {0U, 300U, 2000U, 60'000U}) {
    SCOPED_TRACE(outage_ms);
    RobotOnPaths robot(GetParam());
    robot.connect();
    ASSERT_EQ(robot.drive(100).outcome, Outcome::confirmed);
    cut(robot, true);
    robot.run(200);
    fail_to_stop(robot);
    robot.run(outage_ms);
    ASSERT_FALSE(drives(robot));
    cut(robot, false);
    expect_rest(robot);
    EXPECT_EQ(robot.restarts, 0) << "the board has not restarted";
    expect_control(robot);
  }
}

// A heartbeat of the session would resume the outputs, until the stop arrives.
TEST_P(FailedStop, SendsNoHeartbeatThatCouldArriveBeforeTheStop) {
  for (std::uint32_t call_ms = 1020; call_ms <= 2000; call_ms += 140) {
    for (std::uint32_t back_ms = 1; back_ms < 1000; back_ms += 8) {
      RobotOnPaths robot(GetParam());
      robot.keeps_states = false;
      robot.connect();
      ASSERT_EQ(robot.drive(100).outcome, Outcome::confirmed);
      cut(robot, true);
      robot.run(call_ms);
      (void)robot.send(Command::stop());
      robot.run(back_ms);
      cut(robot, false);
      robot.run(600);
      EXPECT_EQ(robot.trips, 1) << call_ms << ' ' << back_ms;
      EXPECT_FALSE(drives(robot));
    }
  }
}

TEST_P(FailedStop, IsNotFollowedByTheEarlierOutputsInAHostThatStoodStill) {
  RobotOnPaths robot(GetParam());
  robot.connect();
  ASSERT_EQ(robot.drive(100).outcome, Outcome::confirmed);
  cut(robot, true);
  robot.run(1200);
  (void)robot.send(Command::stop());
  robot.run(700);
  cut(robot, false);
  lose(robot, "E:STOP");
  robot.stall(900);  // the stop fails meanwhile, and heartbeats of the board arrive
  expect_rest(robot);
  EXPECT_EQ(robot.trips, 1);
}

TEST_P(FailedStop, LatchesIfTheLinkReturnsBeforeTheBoardIsSafe) {
  Settings settings;
  settings.timeout_ms = 5000;
  RobotOnPaths robot(GetParam(), RobotOnPaths::at_will(), BoardRole::control, settings);
  robot.connect();
  ASSERT_EQ(robot.drive(100).outcome, Outcome::confirmed);
  cut_to_board(robot, true);
  fail_to_stop(robot);
  cut_to_board(robot, false);
  ASSERT_TRUE(drives(robot));
  robot.run(40);
  EXPECT_EQ(robot.board(0).reason(), SafeReason::stop);
  expect_rest(robot);
  expect_control(robot);
}

TEST_P(FailedStop, EndsTheSessionByAFarewellIfTheBoardReceivesThat) {
  RobotOnPaths robot(GetParam());
  robot.connect();
  ASSERT_EQ(robot.drive(100).outcome, Outcome::confirmed);
  lose(robot, "E:STOP");
  fail_to_stop(robot);
  robot.run(20);
  EXPECT_FALSE(drives(robot));
  expect_rest(robot);
  expect_control(robot);
}

TEST_P(FailedStop, IsRepeatedForTheTimeoutOfTheLinkOnly) {
  RobotOnPaths robot(GetParam());
  robot.connect();
  cut_to_board(robot, true);
  fail_to_stop(robot);
  robot.cables[0].sent.clear();
  robot.run(900);
  EXPECT_GT(robot.cables[0].all('E').size(), 40U);
  robot.run(200);
  robot.cables[0].sent.clear();
  robot.run(1000);
  EXPECT_TRUE(robot.cables[0].all('E').empty());
}

TEST_P(FailedStop, CancelsCommandsAndArmsThatWait) {
  RobotOnPaths robot(GetParam(), SessionOptions());
  robot.connect();
  const Ticket arm = robot.session->arm(RobotOnPaths::timeout, robot.now());
  ASSERT_EQ(robot.finish(arm).outcome, Outcome::confirmed);
  ASSERT_EQ(robot.drive(100).outcome, Outcome::confirmed);
  cut(robot, true);
  const Ticket stop = robot.send(Command::stop());
  robot.run(500);
  const Ticket late = robot.session->arm(std::chrono::seconds{30}, robot.now());
  ASSERT_EQ(robot.finish(stop).outcome, Outcome::timed_out);
  EXPECT_EQ(robot.finish(late).outcome, Outcome::cancelled);
  EXPECT_EQ(robot.session->disarmed_by(), DisarmCause::stop);
  cut(robot, false);
  expect_rest(robot);
  EXPECT_EQ(robot.drive(50).outcome, Outcome::not_armed);
}

TEST_P(FailedStop, CancelsACommandThatWaitedForTheLink) {
  RobotOnPaths robot(GetParam());
  robot.connect();
  cut(robot, true);
  const Ticket stop = robot.send(Command::stop());
  robot.run(500);
  const auto command = Command::osmc(1, Pwm(100), Direction::forward);
  const Ticket late = robot.session->send(command, std::chrono::seconds{30}, robot.now());
  ASSERT_EQ(robot.finish(stop).outcome, Outcome::timed_out);
  cut(robot, false);
  expect_rest(robot);
  EXPECT_EQ(robot.finish(late).outcome, Outcome::cancelled);
}

TEST_P(FailedStop, IsConfirmedLaterAndThenRepeatedForAShortTimeOnly) {
  RobotOnPaths robot(GetParam());
  robot.connect();
  cut(robot, true);
  fail_to_stop(robot);
  cut(robot, false);
  robot.run(300);
  ASSERT_EQ(robot.board(0).reason(), SafeReason::stop);
  robot.cables[0].sent.clear();
  robot.run(1000);
  for (const std::string& each : robot.cables[0].all('E')) {
    EXPECT_FALSE(each.starts_with("E:STOP")) << each;
  }
}

TEST_P(FailedStop, KeepsTheLinkIfTheTimeoutWasTooShort) {
  RobotOnPaths robot(GetParam());
  robot.connect();
  ASSERT_EQ(robot.drive(100).outcome, Outcome::confirmed);
  const Ticket stop =
      robot.session->send(Command::stop(), std::chrono::milliseconds{1}, robot.now());
  EXPECT_EQ(robot.finish(stop).outcome, Outcome::timed_out);
  expect_rest(robot);
  EXPECT_EQ(robot.board(0).reason(), SafeReason::stop);
  expect_control(robot);
}

// While a stop is under way and the link is not up, the host sends no heartbeats.
TEST_P(FailedStop, DoesNotKeepTheHostFromItsFirstConnection) {
  RobotOnPaths robot(GetParam());
  cut(robot, true);
  robot.connect();
  fail_to_stop(robot);
  robot.run(1500);
  cut(robot, false);
  robot.run(1000);
  EXPECT_FALSE(drives(robot));
  expect_control(robot);
}

TEST_P(FailedStop, IsConfirmedAfterEachOutageIfTheProgramRepeatsIt) {
  RobotOnPaths robot(GetParam());
  robot.connect();
  ASSERT_EQ(robot.drive(100).outcome, Outcome::confirmed);
  cut(robot, true);
  for (int i = 0; i < 3; ++i) fail_to_stop(robot);
  const Ticket stop = robot.send(Command::stop());
  robot.run(500);
  cut(robot, false);
  EXPECT_EQ(robot.finish(stop).outcome, Outcome::confirmed);
  EXPECT_EQ(robot.trips, 1);
  expect_control(robot);
}

TEST_P(FailedStop, IsExplainedByTheLinkAsItWas) {
  RobotOnPaths robot(GetParam());
  robot.connect();
  lose(robot, "E:");
  const Ticket ticket = robot.send(Command::stop());
  const CommandResult result = robot.finish(ticket);
  const Problem problem = explain(Command::stop(), result, robot.links.back());
  EXPECT_NE(problem.reason.find("streams its state, and reports no stop"), std::string::npos)
      << problem.reason;
}

INSTANTIATE_TEST_SUITE_P(Paths, FailedStop, ::testing::Values(Cables{{1}}, Cables{{1}, {5}}));

}  // namespace
}  // namespace r4::test
