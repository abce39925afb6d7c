// SPDX-License-Identifier: GPL-3.0-or-later
// A course of waypoints, and the motion along it by pure pursuit (Coulter, Implementation of the
// Pure Pursuit Path Tracking Algorithm, CMU-RI-TR-92-01). The motion is slower near the end of the
// course.
#pragma once

#include <r4link/control/kinematics.hpp>
#include <r4link/control/odometry.hpp>
#include <vector>

struct Waypoint {
  double x_m = 0;
  double y_m = 0;
};

class Course {
 public:
  // At least two waypoints. The course begins at the first waypoint.
  explicit Course(std::vector<Waypoint> waypoints, double lookahead_m = 1.5);
  // Bernoulli's lemniscate through the origin, `reach_m` to each side. Its curvature grows evenly
  // towards both ends, where the radius is a third of `reach_m`.
  static Course figure_of_eight(double reach_m);
  // From `from` to any goal: along a circle until the vehicle faces the goal, then straight. Throws
  // if the vehicle stands at the goal.
  static Course towards(const Waypoint& goal, const r4::control::Pose& from);

  // The motion at `pose`; standstill after the end of the course.
  r4::control::Twist wish(const r4::control::Pose& pose, double cruise_m_s);
  bool finished() const { return finished_; }
  double length_m() const { return lengths_.back(); }
  // Distance of a place from the course, near the last call of wish(). Positive to the left.
  double deviation_m(double x_m, double y_m) const;
  // The direction at the beginning of the course.
  double heading_rad() const;

 private:
  Waypoint at(double way_m) const;
  double nearest(double x_m, double y_m, double from_m, double to_m) const;

  std::vector<Waypoint> waypoints_;
  std::vector<double> lengths_;  // from the start to each waypoint
  double lookahead_m_;
  double way_m_ = 0;  // distance travelled along the course
  bool finished_ = false;
};
