// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/control/kinematics.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "r4link/error.hpp"

namespace r4::control {
namespace {

void expect_near(const Twist& is, const Twist& wanted) {
  EXPECT_NEAR(is.forward_m_s, wanted.forward_m_s, 1e-12);
  EXPECT_NEAR(is.turn_rad_s, wanted.turn_rad_s, 1e-12);
}

TEST(DifferentialDrive, TurnsLeftByItsRightWheel) {
  const DifferentialDrive drive({.separation_m = 0.5});
  EXPECT_EQ(drive.wheels({1, 0}), (DifferentialDrive::Wheels{1, 1}));
  EXPECT_EQ(drive.wheels({0, 2}), (DifferentialDrive::Wheels{-0.5, 0.5}));
  for (const Twist& twist : {Twist{1, 0.3}, Twist{-0.4, 2}, Twist{0, -1}}) {
    expect_near(drive.twist(drive.wheels(twist)), twist);
  }
}

TEST(DifferentialDrive, SlowsDownOnTheSamePathAtTheWheelSpeedLimit) {
  const DifferentialDrive drive({.separation_m = 0.5, .max_wheel_m_s = 1});
  const auto wheels = drive.wheels({2, -4});
  EXPECT_EQ(wheels, (DifferentialDrive::Wheels{1, 1.0 / 3}));
  const Twist slower = drive.twist(wheels);
  EXPECT_NEAR(slower.turn_rad_s / slower.forward_m_s, -2, 1e-12);
}

TEST(FourWheelDrive, TurnsWithMoreWheelSpeedToAllowForSlip) {
  const FourWheelDrive drive({.track_m = 0.4, .slip = 1.5});
  const auto wheels = drive.wheels({1, 1});
  EXPECT_NEAR(wheels.front_left_m_s, 0.7, 1e-12);
  EXPECT_EQ(wheels.front_left_m_s, wheels.rear_left_m_s);
  EXPECT_NEAR(wheels.rear_right_m_s, 1.3, 1e-12);
  expect_near(drive.twist(wheels), {1, 1});
  expect_near(drive.twist({0.6, 0.8, 1.4, 1.2}), {1, 1});
}

TEST(Ackermann, ConvertsATwistToSteeringAndBack) {
  const Ackermann car(
      {.wheelbase_m = 1, .track_m = 0.6, .max_steering_rad = 0.6, .max_speed_m_s = 2});
  const auto command = car.command({1, 0.5});
  EXPECT_NEAR(std::tan(command.steering_rad), 0.5, 1e-12);
  for (const Twist& twist : {Twist{1, 0.5}, Twist{-1, 0.5}, Twist{0.3, -0.1}}) {
    expect_near(car.twist(car.command(twist)), twist);
  }
  EXPECT_LT(car.command({-1, 0.5}).steering_rad, 0)
      << "a car that drives backwards steers the other way";
}

TEST(Ackermann, TurnsAsNarrowAsItCanAndNeverOnTheSpot) {
  const Ackermann car({.wheelbase_m = 1, .max_steering_rad = 0.6, .max_speed_m_s = 2});
  EXPECT_EQ(car.command({0, 1}), (Ackermann::Command{0, 0}));
  EXPECT_EQ(car.command({0.1, 5}).steering_rad, 0.6);
  EXPECT_EQ(car.command({5, 0}), (Ackermann::Command{2, 0}));
}

TEST(Ackermann, GivesEachWheelItsOwnAngleAndSpeed) {
  const Ackermann car({.wheelbase_m = 1, .track_m = 0.6, .max_steering_rad = 0.6});
  const double radius = 1 / std::tan(0.4);
  const auto front = car.front_wheels(0.4);
  EXPECT_NEAR(std::tan(front.left_rad), 1 / (radius - 0.3), 1e-12);
  EXPECT_NEAR(std::tan(front.right_rad), 1 / (radius + 0.3), 1e-12);
  const auto rear = car.rear_wheels({1, 0.4});
  EXPECT_NEAR(rear.left_m_s / rear.right_m_s, (radius - 0.3) / (radius + 0.3), 1e-12);
  EXPECT_NEAR(rear.left_m_s + rear.right_m_s, 2, 1e-12);
}

TEST(Kinematics, RefusesInvalidLengths) {
  EXPECT_THROW(DifferentialDrive({.separation_m = 0}), Error);
  EXPECT_THROW(DifferentialDrive({.separation_m = 1, .max_wheel_m_s = -1}), Error);
  EXPECT_THROW(FourWheelDrive({.track_m = 0.4, .slip = 0}), Error);
  EXPECT_THROW(Ackermann({.wheelbase_m = 1, .max_steering_rad = 1.6}), Error);
  EXPECT_THROW(Ackermann({.wheelbase_m = std::nan(""), .max_steering_rad = 0.6}), Error);
}

}  // namespace
}  // namespace r4::control
