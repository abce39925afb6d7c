// SPDX-License-Identifier: GPL-3.0-or-later
// What the wheels of a robot do when it moves, and how it moves when they do: differential, four wheels that skid, and
// Ackermann.
//
// Units are metres, radians and seconds; x is forward, y to the left, and turning to the left is positive, as ROS has it
// (REP 103). Speeds of wheels are those of their rims. A motion that is too fast for the wheels is made slower as a
// whole: the path stays, and it takes longer.
#pragma once

#include <limits>

#include "../config.hpp"

namespace r4::control {

// How a robot moves: geometry_msgs/Twist of one that drives on the ground.
struct Twist {
  double forward_m_s = 0;
  double turn_rad_s = 0;
  friend bool operator==(const Twist&, const Twist&) = default;
};

inline constexpr double no_limit = std::numeric_limits<double>::infinity();

// Two driven wheels, and a castor.
class R4LINK_API DifferentialDrive {
 public:
  struct Geometry {
    double separation_m = 0;          // of the wheels' middles
    double max_wheel_m_s = no_limit;  // of the faster one
  };
  struct Wheels {
    double left_m_s = 0;
    double right_m_s = 0;
    friend bool operator==(const Wheels&, const Wheels&) = default;
  };
  // Throws Error{usage} for lengths and limits that are not above 0; so do the others.
  explicit DifferentialDrive(const Geometry& geometry);
  Wheels wheels(const Twist& twist) const;
  Twist twist(const Wheels& wheels) const;

 private:
  Geometry geometry_;
};

// Four driven wheels that cannot be steered: to turn, they slip sideways.
class R4LINK_API FourWheelDrive {
 public:
  struct Geometry {
    double track_m = 0;  // from the left wheels to the right ones
    // How much wider than its track such a robot behaves: it turns through 1/slip of the angle that a differential
    // drive would. To be measured on the ground that it drives on, 1.5 to 2 on a hard one (Mandow et al., Experimental
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
  // Of a side, the mean of its wheels counts.
  Twist twist(const Wheels& wheels) const;

 private:
  DifferentialDrive sides_;
};

// A car: the front wheels are steered, the middle of the rear axle is where the robot is. The bicycle with the same
// wheelbase stands for it (Siegwart et al., Introduction to Autonomous Mobile Robots, 2nd ed., 3.2).
class R4LINK_API Ackermann {
 public:
  struct Geometry {
    double wheelbase_m = 0;
    double track_m = 0;               // of both axles; 0: not needed
    double max_steering_rad = 0;      // of the bicycle's front wheel, below a right angle
    double max_speed_m_s = no_limit;  // of the middle of the rear axle
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
  // A path narrower than the steering allows becomes the narrowest; on the spot it cannot turn at all, and stands.
  Command command(const Twist& twist) const;
  // Of speeds and angles beyond the limits, too: what the robot does if it is so.
  Twist twist(const Command& command) const;
  double limited_steering(double steering_rad) const;
  // The angle of each front wheel, so that none slips: the inner one's is larger.
  FrontWheels front_wheels(double steering_rad) const;
  // The rims of the rear wheels, for a motor each or a differential.
  DifferentialDrive::Wheels rear_wheels(const Command& command) const;
  const Geometry& geometry() const { return geometry_; }

 private:
  Geometry geometry_;
};

}  // namespace r4::control
