// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/control/odometry.hpp"

#include <cmath>
#include <cstddef>
#include <numbers>

#include "r4link/error.hpp"

namespace r4::control {

double wrapped(double angle_rad) { return std::remainder(angle_rad, 2 * std::numbers::pi); }

Odometry::Odometry(const OdometryNoise& noise) : noise_(noise) {
  for (const double each : {noise.length_per_m, noise.turn_per_m, noise.turn_per_rad}) {
    if (std::isfinite(each) && each >= 0) continue;
    throw Error(ErrorKind::usage, "Odometry", "a variance is below 0 or not a number",
                "give m^2 and rad^2 a metre, and rad^2 a radian");
  }
}

void Odometry::reset(const Pose& pose, const Covariance& covariance) {
  pose_ = pose;
  pose_.yaw_rad = wrapped(pose.yaw_rad);
  covariance_ = covariance;
}

void Odometry::advance(double length_m, double turn_rad) {
  const double half = turn_rad / 2;
  const double shortening = std::abs(half) < 1e-6 ? 1 : std::sin(half) / half;  // of chord to arc
  const double chord = length_m * shortening;
  const double along_x = std::cos(pose_.yaw_rad + half);
  const double along_y = std::sin(pose_.yaw_rad + half);

  // An error of the earlier angle turns the chord. An error of the step's length moves the end
  // along the chord. An error of the step's angle turns the final heading and, by half, the chord.
  const double c_x = -chord * along_y;
  const double c_y = chord * along_x;
  const double length_x = shortening * along_x;
  const double length_y = shortening * along_y;
  const double length_var = noise_.length_per_m * std::abs(length_m);
  const double turn_var =
      noise_.turn_per_m * std::abs(length_m) + noise_.turn_per_rad * std::abs(turn_rad);

  const auto [xx, xy, xt, yx, yy, yt, tx, ty, tt] = covariance_;
  static_cast<void>(yx), static_cast<void>(tx), static_cast<void>(ty);
  covariance_[0] = xx + 2 * c_x * xt + c_x * c_x * tt + length_var * length_x * length_x +
                   turn_var * c_x * c_x / 4;
  covariance_[1] = xy + c_y * xt + c_x * yt + c_x * c_y * tt + length_var * length_x * length_y +
                   turn_var * c_x * c_y / 4;
  covariance_[2] = xt + c_x * tt + turn_var * c_x / 2;
  covariance_[4] = yy + 2 * c_y * yt + c_y * c_y * tt + length_var * length_y * length_y +
                   turn_var * c_y * c_y / 4;
  covariance_[5] = yt + c_y * tt + turn_var * c_y / 2;
  covariance_[8] = tt + turn_var;
  covariance_[3] = covariance_[1];
  covariance_[6] = covariance_[2];
  covariance_[7] = covariance_[5];

  pose_.x_m += chord * along_x;
  pose_.y_m += chord * along_y;
  pose_.yaw_rad = wrapped(pose_.yaw_rad + turn_rad);
}

std::array<double, 36> Odometry::ros_covariance(double unknown) const {
  constexpr std::size_t axes[] = {0, 1, 5};
  std::array<double, 36> all{};
  for (const std::size_t axis : {2U, 3U, 4U}) all[axis * 7] = unknown;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column) {
      all[axes[row] * 6 + axes[column]] = covariance_[row * 3 + column];
    }
  }
  return all;
}

}  // namespace r4::control
