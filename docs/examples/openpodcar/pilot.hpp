// SPDX-License-Identifier: GPL-3.0-or-later
// Selects the source that drives: a joystick, else cmd_vel, else a goal. No I/O and no clock, so
// tests call it as the program does.
//
//                start pressed                 hold pressed
//      ┌─────┐ ───────────────► ┌───────────┐ ──────────────► ┌────────┐
//      │ off │                  │ automatic │                 │ manual │
//      └─────┘ ◄─────────────── └───────────┘ ◄────────────── └────────┘
//                    end()        start pressed, hold released    │
//         ▲                                                       │
//         └───────────────────────────────────────────────────────┘ end()
//
//     off         the loop does not run, and all messages are dropped
//     automatic   cmd_vel while its messages arrive; else the goal; else the vehicle stands
//     manual      the joystick while hold is held; else the vehicle stands. Start ends manual
//
// end() drops the goal and the commands. end() is called
//     by the stop button,
//     if the joystick is silent, because the person could not stop the vehicle,
//     by Topics if a stop may be lost,
//     by the program at the end of its loop.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <r4link/control/kinematics.hpp>
#include <r4link/control/odometry.hpp>
#include <span>
#include <string>

#include "course.hpp"
#include "podcar.hpp"

// Indexes in sensor_msgs/Joy, for an Xbox pad with joy_node. `ros2 topic echo /joy` shows the
// indexes of your pad.
struct JoyMap {
  std::size_t hold = 4;           // LB: the joystick drives while it is held
  std::size_t start = 7;          // Start
  std::size_t stop = 1;           // B
  std::size_t speed_axis = 1;     // left stick, 1 forward
  std::size_t steering_axis = 3;  // right stick, 1 to the left
};

class Pilot {
 public:
  using Time = std::chrono::steady_clock::time_point;
  enum class Mode { off, automatic, manual };

  // joy_node repeats its message 20 times a second.
  static constexpr std::chrono::milliseconds joy_timeout{300};
  static constexpr std::chrono::milliseconds cmd_vel_timeout{500};
  static constexpr double to_goal_m_s = 0.8;
  static constexpr double backwards_m_s = 0.5;  // slow, because no sensor looks backwards
  static constexpr double farthest_goal_m = 100;
  static constexpr double nearest_goal_m = 0.3;
  static constexpr double most_beside_m = 1.5;  // distance from the course to a goal

  explicit Pilot(const JoyMap& map = {}) : map_(map) {}

  // A message, and its time of arrival. A message with NaN or without these axes and buttons is
  // ignored, except for its stop button. `from` identifies the publisher. Two joysticks at a time
  // end the drive: start held on one would look like repeated presses, and a silent joystick would
  // be hidden by the messages of the other joystick.
  void on_joy(std::span<const float> axes, std::span<const std::int32_t> buttons, Time now,
              std::uint64_t from = 0);
  void on_cmd_vel(const r4::control::Twist& twist, Time now);
  // The reason for refusing the goal; empty if the goal is accepted.
  std::string on_goal(const Waypoint& goal, const r4::control::Pose& from, Time now);

  // The board is armed and the loop begins. Earlier messages are ignored, except a stop.
  void begin(Time now);
  // The motion, within the limits of podcar_geometry. If empty, stop at once; why() has the
  // reason.
  std::optional<r4::control::Twist> wish(const r4::control::Pose& pose, Time now);
  void end(std::string why);

  Mode mode() const { return mode_; }
  // The reason of the last end().
  const std::string& why() const { return why_; }

 private:
  bool commanded(Time now) const { return command_ && now - commanded_ <= cmd_vel_timeout; }
  void forget();
  r4::control::Twist limited(const r4::control::Twist& wish) const;

  JoyMap map_;
  r4::control::Ackermann car_{podcar_geometry};
  Mode mode_ = Mode::off;
  std::string why_;

  Time heard_;              // time of the newest joystick message
  std::uint64_t from_ = 0;  // the publisher of that message
  bool start_was_up_ = false;
  bool held_ = false;
  r4::control::Twist stick_;

  std::optional<r4::control::Twist> command_;  // cmd_vel
  Time commanded_;
  std::optional<Course> course_;  // to the goal
};
