// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/control/kinematics.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "r4link/error.hpp"

namespace r4::control {
namespace {

void require_positive(const char* robot, const char* what, double value) {
  if (value > 0) return;
  throw Error(ErrorKind::usage, robot, std::string(what) + " is not above 0",
              "give lengths in metres and limits in metres a second");
}

DifferentialDrive::Geometry sides_of(const FourWheelDrive::Geometry& geometry) {
  require_positive("FourWheelDrive", "track_m", geometry.track_m);
  require_positive("FourWheelDrive", "slip", geometry.slip);
  return {geometry.track_m * geometry.slip, geometry.max_wheel_m_s};
}

}  // namespace

DifferentialDrive::DifferentialDrive(const Geometry& geometry) : geometry_(geometry) {
  require_positive("DifferentialDrive", "separation_m", geometry.separation_m);
  require_positive("DifferentialDrive", "max_wheel_m_s", geometry.max_wheel_m_s);
}

DifferentialDrive::Wheels DifferentialDrive::wheels(const Twist& twist) const {
  const double half = twist.turn_rad_s * geometry_.separation_m / 2;
  const Wheels wanted{twist.forward_m_s - half, twist.forward_m_s + half};
  const double fastest = std::max(std::abs(wanted.left_m_s), std::abs(wanted.right_m_s));
  const double scale = fastest > geometry_.max_wheel_m_s ? geometry_.max_wheel_m_s / fastest : 1;
  return {wanted.left_m_s * scale, wanted.right_m_s * scale};
}

Twist DifferentialDrive::twist(const Wheels& wheels) const {
  return {(wheels.left_m_s + wheels.right_m_s) / 2,
          (wheels.right_m_s - wheels.left_m_s) / geometry_.separation_m};
}

FourWheelDrive::FourWheelDrive(const Geometry& geometry) : sides_(sides_of(geometry)) {}

FourWheelDrive::Wheels FourWheelDrive::wheels(const Twist& twist) const {
  const DifferentialDrive::Wheels side = sides_.wheels(twist);
  return {side.left_m_s, side.left_m_s, side.right_m_s, side.right_m_s};
}

Twist FourWheelDrive::twist(const Wheels& wheels) const {
  return sides_.twist({(wheels.front_left_m_s + wheels.rear_left_m_s) / 2,
                       (wheels.front_right_m_s + wheels.rear_right_m_s) / 2});
}

Ackermann::Ackermann(const Geometry& geometry) : geometry_(geometry) {
  require_positive("Ackermann", "wheelbase_m", geometry.wheelbase_m);
  require_positive("Ackermann", "max_steering_rad", geometry.max_steering_rad);
  require_positive("Ackermann", "max_speed_m_s", geometry.max_speed_m_s);
  if (!(geometry.max_steering_rad < std::numbers::pi / 2) || !(geometry.track_m >= 0)) {
    throw Error(ErrorKind::usage, "Ackermann",
                "max_steering_rad reaches a right angle, or track_m is below 0",
                "give radians, such as 0.6, and metres");
  }
}

double Ackermann::limited_steering(double steering_rad) const {
  return std::clamp(steering_rad, -geometry_.max_steering_rad, geometry_.max_steering_rad);
}

Ackermann::Command Ackermann::command(const Twist& twist) const {
  if (twist.forward_m_s == 0) return {};
  const double curvature = twist.turn_rad_s / twist.forward_m_s;
  const double speed =
      std::clamp(twist.forward_m_s, -geometry_.max_speed_m_s, geometry_.max_speed_m_s);
  return {speed, limited_steering(std::atan(geometry_.wheelbase_m * curvature))};
}

Twist Ackermann::twist(const Command& command) const {
  return {command.speed_m_s,
          command.speed_m_s * std::tan(command.steering_rad) / geometry_.wheelbase_m};
}

// Each wheel is at a right angle to the line from the turning centre. The turning centre is
// wheelbase / tan(steering) to the left of the rear axle's middle.
Ackermann::FrontWheels Ackermann::front_wheels(double steering_rad) const {
  const double tangent = std::tan(steering_rad);
  const double half = geometry_.track_m / 2 / geometry_.wheelbase_m * tangent;
  return {std::atan(tangent / (1 - half)), std::atan(tangent / (1 + half))};
}

DifferentialDrive::Wheels Ackermann::rear_wheels(const Command& command) const {
  const double half = twist(command).turn_rad_s * geometry_.track_m / 2;
  return {command.speed_m_s - half, command.speed_m_s + half};
}

}  // namespace r4::control
