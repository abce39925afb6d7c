// SPDX-License-Identifier: GPL-3.0-or-later
// Wheel speeds for a motion, and the reverse: differential drive, skid steering, Ackermann. Units:
// metres, radians, seconds. x is forward, y to the left, left turns are positive (REP 103). Wheel
// speeds are rim speeds. A motion too fast for the wheels is slowed: same path, longer time.
#pragma once

#include <limits>

#include "../config.hpp"

namespace r4::control {

// The motion of a ground robot: the part of geometry_msgs/Twist that it can execute.
struct Twist {
  double forward_m_s = 0;
  double turn_rad_s = 0;
  friend bool operator==(const Twist&, const Twist&) = default;
};

inline constexpr double no_limit = std::numeric_limits<double>::infinity();

class R4LINK_API DifferentialDrive {
 public:
  struct Geometry {
    double separation_m = 0;          // between the centres of the wheels
    double max_wheel_m_s = no_limit;  // limit of the faster wheel
  };
  struct Wheels {
    double left_m_s = 0;
    double right_m_s = 0;
    friend bool operator==(const Wheels&, const Wheels&) = default;
  };
  // Throws Error{usage} for lengths and limits that are not above 0, as do the constructors below.
  explicit DifferentialDrive(const Geometry& geometry);
  Wheels wheels(const Twist& twist) const;
  Twist twist(const Wheels& wheels) const;

 private:
  Geometry geometry_;
};

// Four driven wheels without steering: they slip sideways in turns.
class R4LINK_API FourWheelDrive {
 public:
  struct Geometry {
    double track_m = 0;  // from left to right wheels
    // The effective track divided by the track: the robot turns by 1/slip of a differential drive's
    // angle. Measure the slip on your ground; 1.5 to 2 on hard ground (Mandow et al., Experimental
    // kinematics for wheeled skid-steer mobile robots, IROS 2007).
    double slip = 1.5;
    double max_wheel_m_s = no_limit;
  };
  struct Wheels {
    double front_left_m_s = 0;
    double rear_left_m_s = 0;
    double front_right_m_s = 0;
    double rear_right_m_s = 0;
    friend bool operator==(const Wheels&, const Wheels&) = default;
  };
  explicit FourWheelDrive(const Geometry& geometry);
  Wheels wheels(const Twist& twist) const;
  // Uses the mean speed of the two wheels on each side.
  Twist twist(const Wheels& wheels) const;

 private:
  DifferentialDrive sides_;
};

// A car whose position is the middle of the rear axle. Computed as a bicycle with the same
// wheelbase (Siegwart et al., Introduction to Autonomous Mobile Robots, 2nd ed., 3.2).
class R4LINK_API Ackermann {
 public:
  struct Geometry {
    double wheelbase_m = 0;
    double track_m = 0;               // of both axles; 0: not needed
    double max_steering_rad = 0;      // of the bicycle's front wheel, below pi/2
    double max_speed_m_s = no_limit;  // limit of the middle of the rear axle
  };
  struct Command {
    double speed_m_s = 0;
    double steering_rad = 0;
    friend bool operator==(const Command&, const Command&) = default;
  };
  struct FrontWheels {
    double left_rad = 0;
    double right_rad = 0;
  };
  explicit Ackermann(const Geometry& geometry);
  // A curve too tight for the steering becomes the tightest possible; a turn on the spot becomes 0.
  Command command(const Twist& twist) const;
  // Also accepts speeds and angles beyond the limits.
  Twist twist(const Command& command) const;
  double limited_steering(double steering_rad) const;
  // The angle of each front wheel without slip: larger for the inner wheel.
  FrontWheels front_wheels(double steering_rad) const;
  // Rim speeds of the rear wheels, for two motors or a differential.
  DifferentialDrive::Wheels rear_wheels(const Command& command) const;
  const Geometry& geometry() const { return geometry_; }

 private:
  Geometry geometry_;
};

}  // namespace r4::control
