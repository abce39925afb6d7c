// SPDX-License-Identifier: GPL-3.0-or-later
// A host that slept, with the real board. The host's clock stops during the sleep, and the host
// begins another session.
#include <gtest/gtest.h>

#include "robot_on_paths.hpp"

namespace r4::test {
namespace {

using Cable = RobotOnPaths::Cable;
using Cables = RobotOnPaths::Cables;

class SleepingHost : public ::testing::TestWithParam<Cables> {
 protected:
  static bool drives(RobotOnPaths& robot) { return robot.board(0).outputs().osmc[0].pwm != 0; }

  void cut_all(RobotOnPaths& of, bool is_cut = true) {
    for (std::size_t path = 0; path < of.cables.size(); ++path) of.cut(path, is_cut);
  }
  static void expect_rest(RobotOnPaths& of, int duration_ms = 5000) {
    for (int ms = 0; ms < duration_ms; ++ms) {
      of.run(1);
      ASSERT_FALSE(drives(of)) << ms << " ms later";
    }
  }
  // All sleeps are longer than the time that the board waits for its host. Some sleeps are shorter
  // than the tolerance of the board's clock, and some sleeps are longer.
  static constexpr std::uint32_t naps_ms[] = {1500, 9000, 60'000};

  RobotOnPaths robot{GetParam()};
};

// If a session continues with recovery=last, the board restores its outputs.
TEST_P(SleepingHost, FindsTheMotorsOffAndLeavesThemOff) {
  for (const std::uint32_t nap_ms : naps_ms) {
    RobotOnPaths sleeper(GetParam());
    sleeper.connect();
    ASSERT_EQ(sleeper.drive(100).outcome, Outcome::confirmed);
    SCOPED_TRACE(nap_ms);
    sleeper.sleep(nap_ms);
    ASSERT_FALSE(drives(sleeper));
    expect_rest(sleeper);
    EXPECT_EQ(sleeper.restarts, 1);
    EXPECT_TRUE(sleeper.session->in_control(sleeper.now()));
    EXPECT_EQ(sleeper.drive(50).outcome, Outcome::confirmed)
        << "the board must obey the host again";
  }
}

TEST_P(SleepingHost, FindsTheMotorsOffAfterAPauseOfItsVirtualMachine) {
  robot.connect();
  ASSERT_EQ(robot.drive(100).outcome, Outcome::confirmed);
  robot.pause(60'000);
  expect_rest(robot);
  EXPECT_EQ(robot.restarts, 1);
  EXPECT_TRUE(robot.session->in_control(robot.now()));
}

// These commands were not sent before the sleep: the board was not connected yet, the link was
// lost, or the board had restarted.
TEST_P(SleepingHost, CancelsEarlierCommandsAndArms) {
  enum class Link { never_heard, lost, restarted };
  for (const Link link : {Link::never_heard, Link::lost, Link::restarted}) {
    RobotOnPaths armed(GetParam(), SessionOptions());
    if (link == Link::never_heard) cut_all(armed);
    armed.connect();
    if (link != Link::never_heard) cut_all(armed);
    armed.run(1500);
    const Ticket arm = armed.session->arm(std::chrono::seconds{30}, armed.now());
    const auto command = Command::osmc(1, Pwm(100), Direction::forward);
    const Ticket drive = armed.session->send(command, std::chrono::seconds{30}, armed.now());
    if (link == Link::restarted) armed.reboot(0);
    armed.sleep(9000);
    cut_all(armed, false);
    expect_rest(armed);
    EXPECT_EQ(armed.finish(arm).outcome, Outcome::cancelled);
    EXPECT_EQ(armed.finish(drive).outcome, Outcome::cancelled);
    if (link == Link::lost) {
      EXPECT_EQ(armed.session->disarmed_by(), DisarmCause::sleep);
    }
  }
}

TEST_P(SleepingHost, SwitchesTheMotorsOffBeforeALongBoardTimeout) {
  Settings settings;
  settings.timeout_ms = 10'000;
  RobotOnPaths patient(GetParam(), RobotOnPaths::at_will(), BoardRole::control, settings);
  patient.connect();
  ASSERT_EQ(patient.drive(100).outcome, Outcome::confirmed);
  patient.sleep(3000);
  ASSERT_TRUE(drives(patient)) << "the board's timeout has not ended yet";
  patient.run(99);
  expect_rest(patient, 3000);
  EXPECT_TRUE(patient.session->in_control(patient.now()));
}

// The command was being sent when the host went to sleep, so it may arrive late or never.
TEST_P(SleepingHost, RepeatsNoEarlierCommand) {
  for (const std::uint32_t later_ms : {0U, 10U, 60U}) {
    RobotOnPaths sender(GetParam());
    sender.connect();
    cut_all(sender);
    const auto command = Command::osmc(1, Pwm(100), Direction::forward);
    const Ticket ticket = sender.session->send(command, std::chrono::seconds{30}, sender.now());
    sender.run(later_ms);
    sender.sleep(60'000);
    cut_all(sender, false);
    expect_rest(sender);
    EXPECT_EQ(sender.finish(ticket).outcome, Outcome::cancelled);
  }
}

TEST_P(SleepingHost, CompletesAStopSentBeforeTheSleep) {
  robot.connect();
  ASSERT_EQ(robot.drive(100).outcome, Outcome::confirmed);
  cut_all(robot);
  const Ticket stop = robot.session->send(Command::stop(), std::chrono::seconds{30}, robot.now());
  robot.sleep(60'000);
  cut_all(robot, false);
  EXPECT_EQ(robot.finish(stop, 5000).outcome, Outcome::confirmed);
  EXPECT_EQ(robot.board(0).reason(), SafeReason::stop);
}

TEST_P(SleepingHost, GetsStatesAgainAsAWatcher) {
  RobotOnPaths watcher(GetParam(), RobotOnPaths::at_will(), BoardRole::watch);
  watcher.connect();
  watcher.run(1000);
  ASSERT_GT(watcher.told_states, 50U);
  watcher.sleep(60'000);
  watcher.run(3000);
  watcher.told_states = 0;
  watcher.run(1000);
  EXPECT_GT(watcher.told_states, 50U);
}

INSTANTIATE_TEST_SUITE_P(Paths, SleepingHost,
                         ::testing::Values(Cables{{1}}, Cables{{40}}, Cables{{1}, {5}}));

}  // namespace
}  // namespace r4::test
