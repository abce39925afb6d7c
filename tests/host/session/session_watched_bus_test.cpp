// SPDX-License-Identifier: GPL-3.0-or-later
// A watcher of a board over a bus and another path. On a bus a watcher must not send questions.
#include <gtest/gtest.h>

#include <optional>
#include <string>

#include "robot_on_paths.hpp"
#include "tests/support/datagrams.hpp"

namespace r4::test {
namespace {

using Cables = RobotOnPaths::Cables;

// Two paths. The second path or both paths are buses.
class WatchedBus : public testing::Test {
 protected:
  explicit WatchedBus(std::size_t board_of_bus = 0, bool first_is_asked = true) {
    Cables cables{{1}, {1, board_of_bus}};
    cables[0].listens = !first_is_asked;
    cables[1].listens = true;
    robot_.emplace(cables, SessionOptions{}, BoardRole::watch);
  }
  RobotOnPaths& robot() { return *robot_; }
  PathState state(std::size_t path) { return robot().session->path(path, robot().now()).state; }

 private:
  std::optional<RobotOnPaths> robot_;
};

TEST_F(WatchedBus, CarriesNextToAnIdentifiedPath) {
  robot().connect();
  robot().run(2000);
  EXPECT_EQ(robot().session->link().carrying, 3);
  EXPECT_TRUE(robot().session->link().causes.empty());
  robot().cut(0);
  robot().told_states = 0;
  robot().run(1500);
  EXPECT_EQ(state(0), PathState::silent);
  EXPECT_NEAR(static_cast<double>(robot().told_states), 150, 3);
  EXPECT_EQ(robot().restarts, 0);
}

TEST_F(WatchedBus, CarriesAgainAfterARestartOfTheBoard) {
  robot().connect();
  robot().run(2000);
  for (const bool alone : {false, true}) {
    robot().cut(0, alone);
    robot().run(12'000);  // the clock must differ from the clock before the restart
    const int restarts = robot().restarts;
    robot().reboot(0);
    robot().run(3000);
    EXPECT_EQ(robot().restarts, restarts + 1);
    EXPECT_EQ(state(1), PathState::carrying) << alone;
    EXPECT_TRUE(robot().session->link().causes.empty());
  }
}

struct WatchedBusOfAnother : WatchedBus {
  WatchedBusOfAnother() : WatchedBus(1) {}
};

TEST_F(WatchedBusOfAnother, IsNeverUsed) {
  robot().connect();
  robot().run(3000);
  EXPECT_EQ(robot().session->link().cause(), LinkCause::other_board);
  EXPECT_EQ(state(1), PathState::other_board);
  robot().cut(0);
  robot().told_states = 0;
  robot().run(3000);
  EXPECT_EQ(robot().told_states, 0U)
      << "a wrong board must not be heard when the right board is silent";
  EXPECT_EQ(robot().restarts, 0);
}

TEST_F(WatchedBusOfAnother, PreventsTheSessionIfItIsHeardFirst) {
  for (const std::size_t path : {0U, 1U}) robot().plug(path, true);
  robot().bring(1, with_crc("AIN24:24;PNum:5;T:" + std::to_string(robot().board_ms(1)) + ";"));
  robot().run(1000);
  EXPECT_EQ(robot().session->link().cause(), LinkCause::two_boards);
  EXPECT_EQ(robot().session->link().state, HostLinkState::connecting);
  EXPECT_EQ(robot().told_states, 0U);
}

struct TwoWatchedBuses : WatchedBus {
  TwoWatchedBuses() : WatchedBus(0, false) {}
};

TEST_F(TwoWatchedBuses, BothCarryAgainAfterAPowerCycle) {
  robot().connect();
  robot().run(2000);
  EXPECT_EQ(robot().session->link().carrying, 3);
  for (const std::size_t path : {0U, 1U}) robot().plug(path, false);
  robot().reboot(0);
  robot().connect();
  robot().run(2000);
  EXPECT_EQ(robot().session->link().carrying, 3);
  EXPECT_TRUE(robot().session->link().causes.empty());
}

struct TwoWatchedBusesOfTwoBoards : WatchedBus {
  TwoWatchedBusesOfTwoBoards() : WatchedBus(1, false) {}
};

TEST_F(TwoWatchedBusesOfTwoBoards, AreNotBothUsed) {
  robot().connect();
  robot().run(2000);
  EXPECT_EQ(robot().session->link().cause(), LinkCause::other_board);
  EXPECT_NE(state(0) == PathState::other_board, state(1) == PathState::other_board);
}

}  // namespace
}  // namespace r4::test
