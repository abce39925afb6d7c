// SPDX-License-Identifier: GPL-3.0-or-later
// A servo of a simulated board, driven in degrees.
#include <gtest/gtest.h>

#include "tests/support/driven_board.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

const ServoCalibration gripper({Microseconds(1000), Degrees(-45)},
                               {Microseconds(2000), Degrees(45)});

template <class... Arguments>
concept SetsServo = requires(Board::ServoChannel servo, Arguments... arguments) {
  servo.set(arguments...);
};
template <class... Arguments>
concept PostsServo = requires(Board::ServoChannel servo, Arguments... arguments) {
  servo.post(arguments...);
};
static_assert(SetsServo<Microseconds> && SetsServo<Degrees> && SetsServo<Degrees, Board::Duration>);
static_assert(!SetsServo<int> && !SetsServo<double> && !SetsServo<Duty>, "a number has no unit");
static_assert(PostsServo<Microseconds> && PostsServo<Degrees> && !PostsServo<int>);

using BoardServo = DrivenBoard;

TEST_F(BoardServo, TurnsToDegreesByItsCalibration) {
  board.servo(3).calibrate(gripper);
  board.servo(16).calibrate({{Microseconds(2000), Degrees(0)}, {Microseconds(1000), Degrees(180)}});
  board.fields("DEFAULT,SERVO3POS,SERVO16POS");
  board.servo(3).set(Degrees(30));
  EXPECT_EQ(board.servo(16).post(Degrees(90)), PostResult::sent);
  board.servo(1).set(Microseconds(1200));
  const State state = board.next_state();
  EXPECT_EQ(state.servo_us(3), 1833);
  EXPECT_EQ(state.servo_us(16), 1500);
  EXPECT_NEAR(board.servo(3).calibration().degrees(state.servo_us(3))->value, 30, 0.05);
  board.servo(3).set(Microseconds(0));
  EXPECT_FALSE(gripper.degrees(board.next_state().servo_us(3)))
      << "a servo that is off has no angle";
}

TEST_F(BoardServo, RefusesDegreesOutsideItsCalibration) {
  board.servo(1).set(Microseconds(1200));
  EXPECT_EQ(problem_of([&] { board.servo(1).set(Degrees(30)); }).text(),
            "servo(1): the servo is not calibrated; call calibrate() first, with the pulse and the "
            "angle at each end of the servo's travel; or set a pulse in microseconds");
  EXPECT_EQ(problem_of([&] { board.servo(1).post(Degrees(30)); }).kind, ErrorKind::usage);
  board.servo(1).calibrate(gripper);
  EXPECT_EQ(problem_of([&] { board.servo(1).set(Degrees(46)); }).kind, ErrorKind::usage);
  EXPECT_EQ(problem_of([&] { board.servo(1).post(Degrees(-46)); }).kind, ErrorKind::usage);
  EXPECT_EQ(board.next_state().servo_us(1), 1200) << "a refused angle must not be sent";
  for (const int none : {-1, 0, 17}) {
    EXPECT_TRUE(
        contains(problem_of([&] { board.servo(none).calibrate(gripper); }).fix, "give 1 to 16"));
    EXPECT_TRUE(
        contains(problem_of([&] { board.servo(none).set(Degrees(0)); }).fix, "give 1 to 16"));
  }
}

TEST_F(BoardServo, KeepsItsCalibrationInAnotherSession) {
  board.servo(1).calibrate(gripper);
  board.release_control();
  board.take_control();
  board.wait_active();
  board.servo(1).set(Degrees(0));
  EXPECT_EQ(board.next_state().servo_us(1), 1500);
}

}  // namespace
}  // namespace r4::test
