// SPDX-License-Identifier: GPL-3.0-or-later
#include "podcar.hpp"

#include <cmath>

namespace {

constexpr double steering_tolerance_rad = 0.004;  // nearer to the goal, the actuator rests
constexpr double standing_m_s = 0.02;
constexpr double driven_rad = 0.05;  // farther away, the actuator has full duty
constexpr double moved_rad = 0.02;
constexpr double most_stuck_s = 0.5;
constexpr double runaway = 1.5;  // times the highest allowed speed

}  // namespace

r4::control::LoopOptions podcar_loop() {
  using namespace std::chrono_literals;
  r4::control::LoopOptions options;
  options.fields = "ENC1,AINSTEER";
  options.late = 150ms;
  options.standstill = {{.encoder = 1, .channel = 1, .pwm = 1500, .counts = 5, .time = 1000ms}};
  options.rest = {r4::Command::osmc(1, r4::Duty(0)), r4::Command::dhb12(1, r4::Duty(0))};
  return options;
}

void Podcar::begin_drive() {
  speed_.reset();
  steering_.reset();
  stuck_s_ = 0;
}

bool Podcar::obeys() const {
  return stuck_s_ < most_stuck_s &&
         std::abs(wheel_.speed_m_s()) < runaway * podcar_geometry.max_speed_m_s;
}

bool Podcar::sense(const r4::State& state) {
  const std::optional<double> angle = sensor_.angle_rad(state);
  if (!angle) return false;
  const double length = wheel_.advance(state);
  // The mean angle between the two states.
  const double steering = (*angle + steering_rad_) / 2;
  odometry_.advance(length, length * std::tan(steering) / podcar_geometry.wheelbase_m);
  steering_rad_ = *angle;
  return true;
}

r4::Setpoints Podcar::drive(const r4::control::Twist& wish, double dt_s) {
  const auto command = car_.command(wish);
  double drive = speed_.step(command.speed_m_s, wheel_.speed_m_s(), dt_s);
  if (command.speed_m_s == 0 && std::abs(wheel_.speed_m_s()) < standing_m_s) {
    speed_.reset();
    drive = 0;
  }
  // At standstill the wheels are not turned.
  const double turn =
      command.speed_m_s == 0 ? 0 : steering_.step(command.steering_rad, steering_rad_, dt_s);
  const double off_rad = std::abs(command.steering_rad - steering_rad_);
  const bool steered = off_rad < steering_tolerance_rad;
  const bool is_driven = command.speed_m_s != 0 && off_rad > driven_rad;
  if (is_driven && std::abs(steering_rad_ - stuck_at_rad_) < moved_rad) {
    stuck_s_ += dt_s;
  } else {
    stuck_at_rad_ = steering_rad_;
    stuck_s_ = 0;
  }
  return {r4::Command::osmc(1, r4::Duty(drive)),
          r4::Command::dhb12(1, r4::Duty(steered ? 0 : turn))};
}
