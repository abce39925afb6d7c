// SPDX-License-Identifier: GPL-3.0-or-later
// A stop that the board does not confirm, with the real board: after the outage the motor must not
// turn again, although the setting `recovery` is `last`.
#include <gtest/gtest.h>

#include "robot_on_paths.hpp"

namespace r4::test {
namespace {

using Cables = RobotOnPaths::Cables;

class UnconfirmedStop : public ::testing::TestWithParam<Cables> {
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
};

TEST_P(UnconfirmedStop, IsNotFollowedByTheEarlierOutputs) {
  for (const std::uint32_t outage_ms : {0U, 300U, 2000U, 60'000U}) {
    SCOPED_TRACE(outage_ms);
    RobotOnPaths robot(GetParam());
    robot.connect();
    ASSERT_EQ(robot.drive(100).outcome, Outcome::confirmed);
    cut(robot, true);
    robot.run(200);
    fail_to_stop(robot);
    robot.run(outage_ms);
    cut(robot, false);
    robot.run(outage_ms < 1000 ? 1000 : 0);  // until the board's timeout at the latest
    expect_rest(robot);
    EXPECT_EQ(robot.restarts, 1);
    EXPECT_EQ(robot.drive(50).outcome, Outcome::confirmed) << "the board must obey the host again";
  }
}

TEST_P(UnconfirmedStop, EndsTheSessionAtOnceIfOnlyTheAnswersAreLost) {
  RobotOnPaths robot(GetParam());
  robot.connect();
  ASSERT_EQ(robot.drive(100).outcome, Outcome::confirmed);
  cut_to_host(robot, true);
  fail_to_stop(robot);
  EXPECT_EQ(robot.board(0).reason(), SafeReason::stop);
  cut_to_host(robot, false);
  expect_rest(robot);
}

// Without its host's heartbeats, a board with a long timeout is safe after this timeout.
TEST_P(UnconfirmedStop, LetsABoardWithALongTimeoutGoSafe) {
  Settings settings;
  settings.timeout_ms = 5000;
  RobotOnPaths robot(GetParam(), RobotOnPaths::at_will(), BoardRole::control, settings);
  robot.connect();
  ASSERT_EQ(robot.drive(100).outcome, Outcome::confirmed);
  cut_to_board(robot, true);
  fail_to_stop(robot);
  cut_to_board(robot, false);
  ASSERT_TRUE(drives(robot));
  robot.run(4100);
  expect_rest(robot);
}

INSTANTIATE_TEST_SUITE_P(Paths, UnconfirmedStop, ::testing::Values(Cables{{1}}, Cables{{1}, {5}}));

}  // namespace
}  // namespace r4::test
