// SPDX-License-Identifier: GPL-3.0-or-later
// r4::control::Odometry: the pose of a robot from the motion of its wheels, and its uncertainty.
// Each step is an arc of a circle with independent errors in length and angle. The variances grow
// with the length and the angle, so the model also fits steered robots. The covariance grows by
// first-order propagation (Siegwart et al., Introduction to Autonomous Mobile Robots, 2nd ed.,
// 5.2.4). Metres and radians; x forward, y and positive angles to the left (REP 103).
#pragma once

#include <array>

#include "../config.hpp"

namespace r4::control {

struct Pose {
  double x_m = 0;
  double y_m = 0;
  double yaw_rad = 0;  // from -pi to pi
  friend bool operator==(const Pose&, const Pose&) = default;
};

// The defaults suit tyres on a hard floor; measure the values of your robot.
struct OdometryNoise {
  double length_per_m = 0.0004;  // m^2 per metre: a standard deviation of 2 cm after one metre
  double turn_per_m = 0.0004;    // rad^2 per metre
  double turn_per_rad = 0.0025;  // rad^2 per radian turned
};

class R4LINK_API Odometry {
 public:
  using Covariance = std::array<double, 9>;  // of x, y, yaw; row by row

  // Throws Error{usage} for a variance that is negative or not a number.
  explicit Odometry(const OdometryNoise& noise = {});

  // The robot has moved by `length_m` (negative: backwards) and turned by `turn_rad` meanwhile.
  void advance(double length_m, double turn_rad);
  void reset(const Pose& pose = {}, const Covariance& covariance = {});

  const Pose& pose() const { return pose_; }
  const Covariance& covariance() const { return covariance_; }
  // For geometry_msgs/PoseWithCovariance. `unknown`: the variance of z, roll and pitch.
  std::array<double, 36> ros_covariance(double unknown = 1e6) const;

 private:
  OdometryNoise noise_;
  Pose pose_;
  Covariance covariance_{};
};

// The angle from -pi to pi.
R4LINK_API double wrapped(double angle_rad);

}  // namespace r4::control
