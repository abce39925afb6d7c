// SPDX-License-Identifier: GPL-3.0-or-later
// r4::control::Odometry: where a robot is, by what its wheels have done, and how far that may be wrong.
//
// Each step is an arc of a circle. Its length and its angle are wrong by independent amounts whose variances grow with
// them, and the covariance of the pose grows by first-order propagation: Siegwart et al., Introduction to Autonomous
// Mobile Robots, 2nd ed., 5.2.4, with the error in length and angle instead of in two wheels, so that it serves steered
// robots as well. Metres and radians, x forward, y to the left, the angle to the left (REP 103).
#pragma once

#include <array>

#include "../config.hpp"

namespace r4::control {

struct Pose {
  double x_m = 0;
  double y_m = 0;
  double yaw_rad = 0;  // within -pi and pi
  friend bool operator==(const Pose&, const Pose&) = default;
};

// The defaults are those of wheels with tyres on a hard floor; measure yours.
struct OdometryNoise {
  double length_per_m =
      0.0004;  // m^2 a metre of the way: 2 cm after one metre, one standard deviation
  double turn_per_m = 0.0004;    // rad^2 a metre of the way
  double turn_per_rad = 0.0025;  // rad^2 a radian turned
};

class R4LINK_API Odometry {
 public:
  using Covariance = std::array<double, 9>;  // of x, y, yaw; row by row

  // Throws Error{usage} for a variance below 0 or that is no number.
  explicit Odometry(const OdometryNoise& noise = {});

  // The robot has gone so far (backwards: below 0), and turned so much meanwhile.
  void advance(double length_m, double turn_rad);
  // It is known to be there.
  void reset(const Pose& pose = {}, const Covariance& covariance = {});

  const Pose& pose() const { return pose_; }
  const Covariance& covariance() const { return covariance_; }
  // The same for geometry_msgs/PoseWithCovariance: of x, y, z and the rotations about them. What moves on the ground
  // knows nothing of the other three, and says so with `unknown`.
  std::array<double, 36> ros_covariance(double unknown = 1e6) const;

 private:
  OdometryNoise noise_;
  Pose pose_;
  Covariance covariance_{};
};

// The angle within -pi and pi.
R4LINK_API double wrapped(double angle_rad);

}  // namespace r4::control
