// SPDX-License-Identifier: GPL-3.0-or-later
#include "course.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <r4link/error.hpp>
#include <utility>

namespace {

constexpr double search_step_m = 0.02;
constexpr double search_ahead_m = 1.5;  // shorter than the course back to the eight's crossing
constexpr double near_m = 0.05;         // nearer to the end, the vehicle has arrived
constexpr double braking_m_s2 = 0.4;
constexpr double slowest_m_s = 0.15;
constexpr double turning_m =
    2.5;  // radius; above the smallest possible radius, so that the steering can correct
constexpr double turning_step_rad = 0.05;

}  // namespace

Course::Course(std::vector<Waypoint> waypoints, double lookahead_m)
    : waypoints_(std::move(waypoints)), lookahead_m_(lookahead_m) {
  lengths_.push_back(0);
  for (std::size_t i = 1; i < waypoints_.size(); ++i) {
    const double length = std::hypot(waypoints_[i].x_m - waypoints_[i - 1].x_m,
                                     waypoints_[i].y_m - waypoints_[i - 1].y_m);
    if (!(length > 0)) break;
    lengths_.push_back(lengths_.back() + length);
  }
  if (waypoints_.size() < 2 || lengths_.size() != waypoints_.size()) {
    throw r4::Error(r4::ErrorKind::usage, "the course",
                    "it has less than two waypoints, or two at one place",
                    "give places in metres, x,y, one after the other");
  }
}

Course Course::figure_of_eight(double reach_m) {
  constexpr int points = 720;
  std::vector<Waypoint> waypoints;
  for (int i = 0; i <= points; ++i) {
    const double angle = 2 * std::numbers::pi * i / points - std::numbers::pi / 2;
    const double scale = reach_m / (1 + std::sin(angle) * std::sin(angle));
    waypoints.push_back({scale * std::cos(angle), scale * std::cos(angle) * std::sin(angle)});
  }
  return Course(std::move(waypoints));
}

Course Course::towards(const Waypoint& goal, const r4::control::Pose& from) {
  const double along_x = std::cos(from.yaw_rad);
  const double along_y = std::sin(from.yaw_rad);
  const double dx = goal.x_m - from.x_m;
  const double dy = goal.y_m - from.y_m;
  const double ahead_m = along_x * dx + along_y * dy;
  const double left_m = along_x * dy - along_y * dx;
  // The circle is on the side of the goal. If the goal is inside that circle, the circle is on the
  // other side.
  double side = left_m < 0 ? -1 : 1;
  if (std::hypot(ahead_m, side * left_m - turning_m) < turning_m) side = -side;
  // The tangent from the circle to the goal: where on the circle it begins, seen from the centre.
  const double beyond_m = side * left_m - turning_m;
  const double distance_m = std::max(turning_m, std::hypot(ahead_m, beyond_m));
  double turn = std::atan2(beyond_m, ahead_m) + std::asin(turning_m / distance_m);
  if (turn < -turning_step_rad) turn += 2 * std::numbers::pi;

  std::vector<Waypoint> waypoints = {{from.x_m, from.y_m}};
  for (double angle = turning_step_rad; angle < turn; angle += turning_step_rad) {
    const double ahead = turning_m * std::sin(angle);
    const double left = side * turning_m * (1 - std::cos(angle));
    waypoints.push_back(
        {from.x_m + along_x * ahead - along_y * left, from.y_m + along_y * ahead + along_x * left});
  }
  waypoints.push_back(goal);
  return Course(std::move(waypoints));
}

double Course::heading_rad() const {
  return std::atan2(waypoints_[1].y_m - waypoints_[0].y_m, waypoints_[1].x_m - waypoints_[0].x_m);
}

// Beyond the end the course continues straight.
Waypoint Course::at(double way_m) const {
  const auto next = std::upper_bound(lengths_.begin() + 1, lengths_.end() - 1, way_m);
  const auto i = static_cast<std::size_t>(std::distance(lengths_.begin(), next));
  const double share = (way_m - lengths_[i - 1]) / (lengths_[i] - lengths_[i - 1]);
  const Waypoint& from = waypoints_[i - 1];
  const Waypoint& to = waypoints_[i];
  return {from.x_m + share * (to.x_m - from.x_m), from.y_m + share * (to.y_m - from.y_m)};
}

double Course::nearest(double x_m, double y_m, double from_m, double to_m) const {
  double best_m = from_m;
  double best = std::numeric_limits<double>::infinity();
  for (double way_m = from_m; way_m <= to_m; way_m += search_step_m) {
    const Waypoint place = at(way_m);
    const double distance = std::hypot(place.x_m - x_m, place.y_m - y_m);
    if (distance < best) {
      best = distance;
      best_m = way_m;
    }
  }
  return best_m;
}

double Course::deviation_m(double x_m, double y_m) const {
  const double way_m =
      nearest(x_m, y_m, std::max(0.0, way_m_ - search_ahead_m), way_m_ + search_ahead_m);
  const Waypoint place = at(way_m);
  const Waypoint on = at(way_m + search_step_m);
  const double along_x = (on.x_m - place.x_m) / search_step_m;
  const double along_y = (on.y_m - place.y_m) / search_step_m;
  return along_x * (y_m - place.y_m) - along_y * (x_m - place.x_m);
}

r4::control::Twist Course::wish(const r4::control::Pose& pose, double cruise_m_s) {
  if (finished_) return {};
  way_m_ = nearest(pose.x_m, pose.y_m, way_m_, std::min(way_m_ + search_ahead_m, length_m()));
  const double left_m = length_m() - way_m_;
  finished_ = left_m < near_m;
  if (finished_) return {};
  const double speed =
      std::min(cruise_m_s, std::max(slowest_m_s, std::sqrt(2 * braking_m_s2 * left_m)));

  const Waypoint goal = at(way_m_ + lookahead_m_);
  const double dx = goal.x_m - pose.x_m;
  const double dy = goal.y_m - pose.y_m;
  const double beside = -std::sin(pose.yaw_rad) * dx + std::cos(pose.yaw_rad) * dy;
  const double curvature = 2 * beside / (dx * dx + dy * dy);
  return {speed, speed * curvature};
}
