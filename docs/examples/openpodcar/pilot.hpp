// SPDX-License-Identifier: GPL-3.0-or-later
// Who drives: a person with a joystick, a program with cmd_vel, or a goal, in this order. Without I/O and clock, so that
// a test asks it as the program does.
//
//                start pressed                 hold pressed
//      ┌─────┐ ───────────────► ┌───────────┐ ──────────────► ┌────────┐
//      │ off │                  │ automatic │                 │ manual │
//      └─────┘ ◄─────────────── └───────────┘ ◄────────────── └────────┘
//                    end()        start pressed, hold released    │
//         ▲                                                       │
//         └───────────────────────────────────────────────────────┘ end()
//
//     off         nobody: the loop does not run, and nothing that comes is kept
//     automatic   cmd_vel, as long as it comes; else the goal; else it stands
//     manual      the joystick while hold is held; else it stands. What a person has taken over is given back by start
//
// end() is called by the stop button, by a joystick that is silent, for then nobody can stop it from afar, by Topics
// where a stop may be lost, and by the program when its loop ends. It forgets goal and commands.
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

// Where they are in sensor_msgs/Joy: here of an Xbox pad with joy_node. `ros2 topic echo /joy` shows yours.
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

  // joy_node repeats itself 20 times a second.
  static constexpr std::chrono::milliseconds joy_timeout{300};
  static constexpr std::chrono::milliseconds cmd_vel_timeout{500};
  static constexpr double to_goal_m_s = 0.8;
  static constexpr double backwards_m_s = 0.5;  // at most: no sensor looks there
  static constexpr double farthest_goal_m = 100;
  static constexpr double nearest_goal_m = 0.3;
  static constexpr double most_beside_m = 1.5;  // of the way to a goal

  explicit Pilot(const JoyMap& map = {}) : map_(map) {}

  // What comes from outside, and when. Numbers that are none, and a joystick without these axes and buttons, count as
  // if they had not come; but for its stop button.
  // `from` tells publishers apart: two joysticks at a time end the drive, for a start that is held on the one looks
  // like one that is pressed again and again, and the other would be heard when the one that drives is not.
  void on_joy(std::span<const float> axes, std::span<const std::int32_t> buttons, Time now,
              std::uint64_t from = 0);
  void on_cmd_vel(const r4::control::Twist& twist, Time now);
  // The reason for refusing the goal; empty if the goal is accepted.
  std::string on_goal(const Waypoint& goal, const r4::control::Pose& from, Time now);

  // The board is armed, and the loop begins: of what came until now only a stop counts.
  void begin(Time now);
  // How to move, within the limits of podcar_geometry. Nothing: stop at once, why() says why.
  std::optional<r4::control::Twist> wish(const r4::control::Pose& pose, Time now);
  void end(std::string why);

  Mode mode() const { return mode_; }
  // Of the last end.
  const std::string& why() const { return why_; }

 private:
  bool commanded(Time now) const { return command_ && now - commanded_ <= cmd_vel_timeout; }
  void forget();
  r4::control::Twist limited(const r4::control::Twist& wish) const;

  JoyMap map_;
  r4::control::Ackermann car_{podcar_geometry};
  Mode mode_ = Mode::off;
  std::string why_;

  Time heard_;              // when the joystick was
  std::uint64_t from_ = 0;  // which one that was
  bool start_was_up_ = false;
  bool held_ = false;
  r4::control::Twist stick_;

  std::optional<r4::control::Twist> command_;  // cmd_vel
  Time commanded_;
  std::optional<Course> course_;  // to the goal
};
