// SPDX-License-Identifier: GPL-3.0-or-later
// One session over several paths to a board that restarts or seems to restart
// (docs/how-to/redundancy.md).
#include <gtest/gtest.h>

#include "robot_on_paths.hpp"
#include "tests/support/datagrams.hpp"

namespace r4::test {
namespace {

using Cable = RobotOnPaths::Cable;
using Cables = RobotOnPaths::Cables;

TEST(SessionPaths, ReportARestartOnceAndCarryAgain) {
  for (const std::uint32_t lag : {1U, 30U, 200U}) {
    RobotOnPaths robot(Cables{{1}, {lag}});
    robot.connect();
    robot.run(1000);
    robot.drive(1);
    for (int boots = 1; boots <= 3; ++boots) {
      robot.run(3000);
      robot.reboot(0);
      robot.run(2000);
      EXPECT_EQ(robot.restarts, boots) << "lag " << lag;
      EXPECT_TRUE(robot.session->in_control(robot.now())) << "lag " << lag;
      EXPECT_EQ(robot.session->link().carrying, 3) << "lag " << lag;
    }
    EXPECT_EQ(robot.drive(2).outcome, Outcome::confirmed);
  }
}

TEST(SessionPaths, ALateBootHeartbeatDoesNotEndTheSession) {
  for (const bool alone : {false, true}) {
    RobotOnPaths robot(Cables{{1}, {1}});
    robot.connect();
    if (alone) robot.plug(1, false);
    robot.run(500);
    robot.links.clear();
    for (int i = 0; i < 20; ++i) {
      robot.bring(0, with_crc("H:R4-ROS2;PNum:0;T:0;"));
      robot.run(5);
    }
    robot.run(1500);
    for (const LinkStatus& each : robot.links) EXPECT_TRUE(is_heard(each.state));
    EXPECT_EQ(robot.restarts, 0);
    EXPECT_EQ(robot.trips, 0);
    EXPECT_EQ(robot.drive(10).outcome, Outcome::confirmed);
  }
}

TEST_F(TwoPaths, RestartTheSessionWhenAnAnswerConfirmsABootHeartbeat) {
  robot.run(500);
  for (Cable& cable : robot.cables) cable.sent.clear();
  robot.bring(0, with_crc("H:R4-ROS2;PNum:0;T:0;"));
  robot.run(110);
  EXPECT_EQ(robot.cables[0].all('Q').size(), robot.cables[1].all('Q').size() + 1)
      << "the session must ask on that path, too";
  EXPECT_EQ(robot.restarts, 0);
  robot.reboot(0);
  robot.run(1500);
  EXPECT_EQ(robot.restarts, 1);
  EXPECT_TRUE(robot.session->in_control(robot.now()));
}

// No answer shows another clock: there is no answer, or the board has restarted with nearly the
// same clock.
TEST(SessionPaths, RepeatedBootHeartbeatsRestartTheSession) {
  for (const bool answers : {false, true}) {
    RobotOnPaths robot(Cables{{1}, {1}});
    robot.connect();
    for (const std::size_t path : {0U, 1U}) robot.cut(path);
    const std::string id = robot.session->path(1, robot.now()).board_id;
    const std::string question = robot.cables[1].all('Q').back();
    const std::string sid = question.substr(question.find("SID:"), 21);
    for (int i = 0; i < 15; ++i) {
      robot.bring(1, with_crc("H:R4-ROS2;PNum:0;T:0;"));
      const std::string answer =
          with_crc("I:R4,0," + id + ",sim;BUSY:0;" + sid + "PNum:" + std::to_string(i) +
                   ";T:" + std::to_string(robot.board_ms(0)) + ";");
      if (answers) robot.bring(1, answer);
      robot.run(100);
    }
    EXPECT_EQ(robot.session->link().state, HostLinkState::connecting) << answers;
    EXPECT_NE(robot.cables[1].all('H').back().find(";T:0;"), std::string::npos) << answers;
  }
}

}  // namespace
}  // namespace r4::test
