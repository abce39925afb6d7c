// SPDX-License-Identifier: GPL-3.0-or-later
// A watcher of a board over a bus and another path. On a bus a watcher must not send questions.
#include <gtest/gtest.h>

#include <string>

#include "robot_on_paths.hpp"
#include "tests/support/datagrams.hpp"

namespace r4::test {
namespace {

using Cables = RobotOnPaths::Cables;

// A watcher with two paths. The second path or both paths are buses.
RobotOnPaths watcher(std::size_t board_of_second = 0, bool first_is_bus = false) {
  Cables cables{{1}, {1, board_of_second}};
  cables[0].listens = first_is_bus;
  cables[1].listens = true;
  return RobotOnPaths(cables, SessionOptions{}, BoardRole::watch);
}

PathState state(const RobotOnPaths& robot, std::size_t path) {
  return robot.session->path(path, robot.now()).state;
}

TEST(WatchedBus, CarriesNextToAnIdentifiedPath) {
  RobotOnPaths robot = watcher();
  robot.connect();
  robot.run(2000);
  EXPECT_EQ(robot.session->link().carrying, 3);
  EXPECT_TRUE(robot.session->link().causes.empty());
  robot.cut(0);
  robot.told_states = 0;
  robot.run(1500);
  EXPECT_EQ(state(robot, 0), PathState::silent);
  EXPECT_NEAR(static_cast<double>(robot.told_states), 150, 3);
  EXPECT_EQ(robot.restarts, 0);
}

TEST(WatchedBus, CarriesAgainAfterARestartOfTheBoard) {
  RobotOnPaths robot = watcher();
  robot.connect();
  robot.run(2000);
  for (const bool alone : {false, true}) {
    robot.cut(0, alone);
    robot.run(12'000);  // the clock must differ from the clock before the restart
    const int restarts = robot.restarts;
    robot.reboot(0);
    robot.run(3000);
    EXPECT_EQ(robot.restarts, restarts + 1);
    EXPECT_EQ(state(robot, 1), PathState::carrying) << alone;
    EXPECT_TRUE(robot.session->link().causes.empty());
  }
}

TEST(WatchedBusOfAnother, IsNeverUsed) {
  RobotOnPaths robot = watcher(1);
  robot.connect();
  robot.run(3000);
  EXPECT_EQ(robot.session->link().cause(), LinkCause::other_board);
  EXPECT_EQ(state(robot, 1), PathState::other_board);
  robot.cut(0);
  robot.told_states = 0;
  robot.run(3000);
  EXPECT_EQ(robot.told_states, 0U)
      << "a wrong board must not be heard when the right board is silent";
  EXPECT_EQ(robot.restarts, 0);
}

TEST(WatchedBusOfAnother, PreventsTheSessionIfItIsHeardFirst) {
  RobotOnPaths robot = watcher(1);
  for (const std::size_t path : {0U, 1U}) robot.plug(path, true);
  robot.bring(1, with_crc("AIN24:24;PNum:5;T:" + std::to_string(robot.board_ms(1)) + ";"));
  robot.run(1000);
  EXPECT_EQ(robot.session->link().cause(), LinkCause::two_boards);
  EXPECT_EQ(robot.session->link().state, HostLinkState::connecting);
  EXPECT_EQ(robot.told_states, 0U);
}

TEST(TwoWatchedBuses, BothCarryAgainAfterAPowerCycle) {
  RobotOnPaths robot = watcher(0, true);
  robot.connect();
  robot.run(2000);
  EXPECT_EQ(robot.session->link().carrying, 3);
  for (const std::size_t path : {0U, 1U}) robot.plug(path, false);
  robot.reboot(0);
  robot.connect();
  robot.run(2000);
  EXPECT_EQ(robot.session->link().carrying, 3);
  EXPECT_TRUE(robot.session->link().causes.empty());
}

TEST(TwoWatchedBusesOfTwoBoards, AreNotBothUsed) {
  RobotOnPaths robot = watcher(1, true);
  robot.connect();
  robot.run(2000);
  EXPECT_EQ(robot.session->link().cause(), LinkCause::other_board);
  EXPECT_NE(state(robot, 0) == PathState::other_board, state(robot, 1) == PathState::other_board);
}

}  // namespace
}  // namespace r4::test
