// SPDX-License-Identifier: GPL-3.0-or-later
// The test of a program causes events on a simulated board while the program drives the board.
#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "r4link/board.hpp"
#include "r4link/error.hpp"
#include "r4link/simulation.hpp"
#include "tests/support/problems.hpp"

namespace r4 {
namespace {

using sim::SimulatedRobot;

State await(Board& board, const std::function<bool(const State&)>& is_so) {
  State state;
  for (int tries = 0; tries < 1000; ++tries) {
    state = board.next_state();
    if (is_so(state)) return state;
  }
  ADD_FAILURE() << "no state fulfils the condition";
  return state;
}

SimulatedRobot::Look await(Board& board, const SimulatedRobot& robot,
                           const std::function<bool(const SimulatedRobot::Look&)>& is_so) {
  SimulatedRobot::Look look;
  await(board, [&](const State&) { return is_so(look = robot.look()); });
  return look;
}

void drive(Board& board) {
  board.wait_active();
  board.arm();
  board.osmc(1).set_pwm(4095, Direction::forward);
}

TEST(SimulatedRobot, ReleasesTheHandleAndShowsThatTheMotorsAreOff) {
  const SimulatedRobot never_opened;
  SimulatedRobot robot;
  EXPECT_FALSE(robot.look().open);
  Board board(robot.url());
  drive(board);
  EXPECT_TRUE(await(board, robot, [](const auto& now) { return now.encoder[0] > 10; }).open);
  EXPECT_EQ(robot.look().pins.osmc[0].pwm, 4095);
  EXPECT_TRUE(robot.look().motors_have_supply);

  robot.happen("handle released");
  EXPECT_FALSE(await(board, [](const State& state) {
                 return state.safe == SafeReason::handle;
               }).handle_held());
  const auto now = await(board, robot, [](const auto& look) { return look.pins.is_safe(); });
  EXPECT_FALSE(now.motors_have_supply || now.handle_held);
  robot.happen("handle held");
  await(board, [](const State& state) { return state.safe == SafeReason::none; });
  EXPECT_FALSE(never_opened.look().open);
  board.close();
  EXPECT_FALSE(robot.look().open);
}

// A robot whose wheels turn at once, and whose sensor shows the duty.
struct LightRobot final : sim::RobotModel {
  void pass_millisecond(const sim::ChipPins& pins, bool supplied, Senses& senses) override {
    const int duty = supplied ? pins.osmc[1].pwm : 0;
    senses.encoder_turned[3] = duty > 0 ? -2 : 0;
    senses.analog_cv[static_cast<int>(Analog::ainsteer)] = duty / 10;
    senses.ultrasonic_cm[2] = duty > 0 ? 77 : 0;
  }
};

TEST(SimulatedRobot, AcceptsARobotModelOfTheProgram) {
  LightRobot light;
  SimulatedRobot robot(light);
  Board board(robot.url());
  board.wait_active();
  board.fields("ENC1,ENC4,AINSTEER,US3");
  EXPECT_EQ(board.next_state().encoder(4), 0);
  board.arm();
  board.osmc(1).set_pwm(4095, Direction::forward);
  board.osmc(2).set_pwm(4000, Direction::forward);
  const State state = await(
      board, [](const State& now) { return now.distance_cm(3) == 77 && now.encoder(4) < -10; });
  EXPECT_EQ(state.encoder(1), 0) << "this robot has no motor of the default bench";
  EXPECT_NEAR(state.volts(Analog::ainsteer), 4.0, 0.02);
}

TEST(SimulatedRobot, AStalledMotorDrawsItsFullCurrent) {
  SimulatedRobot robot;
  robot.happen("motor 1 stalled");  // before the board is opened
  Board board(robot.url());
  drive(board);
  const auto idle = [&] {
    return await(board, robot, [](const auto& now) { return now.analog_cv[0] < 2400; });
  };
  EXPECT_EQ(idle().encoder[0], 0) << "a stalled motor draws 30 A through 20 mOhm and does not turn";
  robot.happen("motor 1 free");
  await(board, robot, [](const auto& now) { return now.encoder[0] > 100; });
}

TEST(SimulatedRobot, WorksInACallbackAndForOneBoardAfterAnother) {
  SimulatedRobot robot;
  for (int i = 0; i < 2; ++i) {
    Board board(robot.url());
    board.on_state([&](const State& state) {
      if (state.safe == SafeReason::none) robot.happen("fault");
    });
    await(board, [](const State& state) { return state.safe == SafeReason::fault; });
  }
}

TEST(SimulatedRobot, ReportsInvalidEventsAndUrls) {
  SimulatedRobot robot;
  EXPECT_EQ(test::problem_of([&] { robot.happen("us 5 10"); }).text(),
            robot.url() + ": '5' is not a valid ultrasonic sensor; there are 1 to 4");
  EXPECT_EQ(test::problem_of([&] { robot.happen("handle"); }).text(),
            robot.url() + ": 'handle' has too few or too many words; write handle held|released");
  EXPECT_NO_THROW(robot.happen(" # nothing happens"));
  const Board board(robot.url());
  EXPECT_TRUE(test::contains(test::problem_of([&] { const Board second(robot.url()); }).text(),
                             "another link"));
  std::string gone;
  {
    const SimulatedRobot other;
    gone = other.url();
  }
  EXPECT_TRUE(test::contains(test::problem_of([&] { const Board none(gone); }).text(),
                             "no such SimulatedRobot"));
}

}  // namespace
}  // namespace r4
