// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/control/odometry.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "r4link/error.hpp"

namespace r4::control {
namespace {

TEST(Odometry, FollowsArcsExactlyWithAnySteps) {
  for (const int steps : {1, 3, 1000}) {
    Odometry odometry;
    for (int i = 0; i < steps; ++i) {
      odometry.advance(2 * std::numbers::pi / steps, std::numbers::pi / steps);  // a radius of 2 m
    }
    EXPECT_NEAR(odometry.pose().x_m, 0, 1e-9);
    EXPECT_NEAR(odometry.pose().y_m, 4, 1e-9);
    EXPECT_NEAR(std::abs(odometry.pose().yaw_rad), std::numbers::pi, 1e-9);
    EXPECT_NEAR(odometry.covariance()[8], 2 * std::numbers::pi * 0.0004 + std::numbers::pi * 0.0025,
                1e-9);
  }
}

TEST(Odometry, GoesBackwardsAndStartsAtAGivenPose) {
  Odometry odometry;
  odometry.advance(1, 0);
  odometry.reset({.x_m = 1, .y_m = 2, .yaw_rad = 5 * std::numbers::pi / 2});
  EXPECT_EQ(odometry.covariance(), Odometry::Covariance());
  odometry.advance(-0.5, 0);
  EXPECT_NEAR(odometry.pose().x_m, 1, 1e-12);
  EXPECT_NEAR(odometry.pose().y_m, 1.5, 1e-12);
  EXPECT_NEAR(odometry.pose().yaw_rad, std::numbers::pi / 2, 1e-12);
}

// Many robots with the wheel errors of the noise model. The spread of their poses must match the
// covariance.
TEST(Odometry, CovarianceMatchesTheSpreadOfPoses) {
  constexpr OdometryNoise noise{
      .length_per_m = 0.0003, .turn_per_m = 0.0003, .turn_per_rad = 0.001};
  constexpr int robots = 20'000, steps = 4;
  constexpr double length = 1.2, turn = 0.3;
  Odometry told(noise);
  for (int i = 0; i < steps; ++i) told.advance(length, turn);

  std::mt19937 random(1);
  std::normal_distribution<double> length_of(length, std::sqrt(noise.length_per_m * length));
  std::normal_distribution<double> turn_of(
      turn, std::sqrt(noise.turn_per_m * length + noise.turn_per_rad * turn));
  Odometry::Covariance spread{};
  for (int robot = 0; robot < robots; ++robot) {
    Odometry one;
    for (int i = 0; i < steps; ++i) one.advance(length_of(random), turn_of(random));
    const double off[] = {one.pose().x_m - told.pose().x_m, one.pose().y_m - told.pose().y_m,
                          wrapped(one.pose().yaw_rad - told.pose().yaw_rad)};
    for (std::size_t i = 0; i < 9; ++i) spread[i] += off[i / 3] * off[i % 3] / robots;
  }
  for (std::size_t i = 0; i < 9; ++i) {
    const double scale = std::sqrt(told.covariance()[i / 3 * 4] * told.covariance()[i % 3 * 4]);
    EXPECT_NEAR(spread[i] / scale, told.covariance()[i] / scale, 0.04) << i;
    EXPECT_EQ(told.covariance()[i], told.covariance()[i % 3 * 3 + i / 3]);
  }
}

TEST(Odometry, RosCovarianceMarksUnknownAxes) {
  Odometry odometry;
  odometry.advance(3, 0.5);
  const auto ros = odometry.ros_covariance(9);
  EXPECT_EQ(ros[0], odometry.covariance()[0]);
  EXPECT_EQ(ros[1 * 6 + 5], odometry.covariance()[1 * 3 + 2]);
  EXPECT_EQ(ros[35], odometry.covariance()[8]);
  EXPECT_EQ(ros[2 * 7], 9);
  EXPECT_EQ(ros[4 * 7], 9);
  EXPECT_EQ(ros[2], 0);
  EXPECT_THROW(Odometry({.length_per_m = -1}), Error);
}

}  // namespace
}  // namespace r4::control
