// SPDX-License-Identifier: GPL-3.0-or-later
#include "pilot.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

using r4::control::Twist;

void Pilot::on_joy(std::span<const float> axes, std::span<const std::int32_t> buttons, Time now,
                   std::uint64_t from) {
  const auto is_down = [&](std::size_t button) {
    return button < buttons.size() && buttons[button] != 0;
  };
  if (is_down(map_.stop)) end("the stop button");
  const bool whole = buttons.size() > std::max({map_.hold, map_.start, map_.stop}) &&
                     axes.size() > std::max(map_.speed_axis, map_.steering_axis) &&
                     std::abs(axes[map_.speed_axis]) <= 1 &&
                     std::abs(axes[map_.steering_axis]) <= 1;  // false for NaN
  if (!whole) return;
  if (from != from_) {
    if (now - heard_ <= joy_timeout) end("there are two joysticks");
    from_ = from;
    start_was_up_ = false;
  }

  // A press is a change from up to down: a button that is down in the first message does not count.
  const bool started = is_down(map_.start) && start_was_up_ && now - heard_ <= joy_timeout;
  start_was_up_ = !is_down(map_.start);
  heard_ = now;
  held_ = is_down(map_.hold);
  stick_ = car_.twist({axes[map_.speed_axis] * podcar_geometry.max_speed_m_s,
                       axes[map_.steering_axis] * podcar_geometry.max_steering_rad});
  if (started && !is_down(map_.stop)) mode_ = Mode::automatic;
  if (held_ && mode_ != Mode::off) {
    mode_ = Mode::manual;
    forget();
  }
}

void Pilot::on_cmd_vel(const Twist& twist, Time now) {
  if (mode_ != Mode::automatic) return;
  if (!std::isfinite(twist.forward_m_s) || !std::isfinite(twist.turn_rad_s)) return;
  forget();
  command_ = twist;
  commanded_ = now;
}

std::string Pilot::on_goal(const Waypoint& goal, const r4::control::Pose& from, Time now) {
  if (mode_ == Mode::off) return "press start first";
  if (mode_ == Mode::manual) return "the joystick drives; press start to give it back";
  if (commanded(now)) return "cmd_vel drives";
  const double distance_m = std::hypot(goal.x_m - from.x_m, goal.y_m - from.y_m);
  if (!(distance_m <= farthest_goal_m)) return "it is too far away, or not a position";
  if (distance_m < nearest_goal_m) return "it is where the vehicle stands";
  course_ = Course::towards(goal, from);
  return {};
}

void Pilot::begin(Time now) {
  heard_ = now;
  held_ = false;
  forget();
}

std::optional<Twist> Pilot::wish(const r4::control::Pose& pose, Time now) {
  if (now - heard_ > joy_timeout) end("the joystick is silent");
  if (course_ && course_->deviation_m(pose.x_m, pose.y_m) > most_beside_m) {
    end("it is off its way to the goal");
  }
  if (mode_ == Mode::off) return std::nullopt;
  if (mode_ == Mode::manual) return held_ ? limited(stick_) : Twist{};
  if (commanded(now)) return limited(*command_);
  if (course_) return limited(course_->wish(pose, to_goal_m_s));
  return Twist{};
}

void Pilot::end(std::string why) {
  if (mode_ == Mode::off) return;
  mode_ = Mode::off;
  why_ = std::move(why);
  forget();
}

void Pilot::forget() {
  command_.reset();
  course_.reset();
}

Twist Pilot::limited(const Twist& wish) const {
  auto command = car_.command(wish);
  command.speed_m_s = std::max(command.speed_m_s, -backwards_m_s);
  return car_.twist(command);
}
