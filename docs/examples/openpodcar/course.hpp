// SPDX-License-Identifier: GPL-3.0-or-later
// A course of waypoints, and the motion that follows it: pure pursuit (Coulter, Implementation of the Pure Pursuit Path
// Tracking Algorithm, CMU-RI-TR-92-01), slower towards its end.
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
  // It begins at the first waypoint; two at least.
  explicit Course(std::vector<Waypoint> waypoints, double lookahead_m = 1.5);
  // Bernoulli's lemniscate through the origin, `reach` to each side: it bends evenly more towards its ends, where the
  // radius is a third of that.
  static Course figure_of_eight(double reach_m);
  // From there to a goal anywhere: along a circle until it looks at the goal, and straight on. Throws if that is where
  // it stands.
  static Course towards(const Waypoint& goal, const r4::control::Pose& from);

  // How to move from there; nothing once the end is reached.
  r4::control::Twist wish(const r4::control::Pose& pose, double cruise_m_s);
  bool finished() const { return finished_; }
  double length_m() const { return lengths_.back(); }
  // How far beside the course that place is, near to where wish() was asked last. To the left: above 0.
  double deviation_m(double x_m, double y_m) const;
  // The direction in which it begins.
  double heading_rad() const;

 private:
  Waypoint at(double way_m) const;
  double nearest(double x_m, double y_m, double from_m, double to_m) const;

  std::vector<Waypoint> waypoints_;
  std::vector<double> lengths_;  // of the way to each
  double lookahead_m_;
  double way_m_ = 0;  // done
  bool finished_ = false;
};
