// SPDX-License-Identifier: GPL-3.0-or-later
#include "model.hpp"

#include <algorithm>
#include <cmath>

#include "podcar.hpp"

namespace {

constexpr double dt_s = 0.001;
constexpr double metres_a_count =
    2 * 3.14159265358979 * podcar_wheel.radius_m / podcar_wheel.counts_a_turn;

double duty_of(const r4::Drive& drive) {
  return (drive.direction == r4::Direction::forward ? 1.0 : -1.0) * drive.pwm / r4::pwm_max;
}

}  // namespace

void PodcarModel::move(double duty, bool supplied) {
  without_supply_ms_ = supplied ? 0 : without_supply_ms_ + 1;
  const double motor = supplied ? stall_force_n * (duty - place_.speed_m_s / top_speed_m_s) : 0;
  const double holding =
      rolling_force_n + (without_supply_ms_ > brake_delay_ms ? brake_force_n : 0);
  const double driven = place_.speed_m_s + motor / mass_kg * dt_s;
  // Friction reduces the speed, but never reverses it.
  const double lost = holding / mass_kg * dt_s;
  place_.speed_m_s = std::abs(driven) <= lost ? 0 : driven - std::copysign(lost, driven);
}

void PodcarModel::steer(double duty) {
  steering_speed_ += (duty * steering_rad_s - steering_speed_) * dt_s / steering_lag_s;
  place_.steering_rad = std::clamp(place_.steering_rad + steering_speed_ * dt_s,
                                   podcar_steering.right_rad, podcar_steering.left_rad);
}

void PodcarModel::pass_millisecond(const r4::sim::ChipPins& pins, bool motors_have_supply,
                                   Senses& senses) {
  move(duty_of(pins.osmc[0]), motors_have_supply);
  steer(motors_have_supply ? duty_of(pins.dhb12[0]) : 0);

  const double rolled = place_.speed_m_s * dt_s;
  place_.x_m += rolled * std::cos(place_.yaw_rad);
  place_.y_m += rolled * std::sin(place_.yaw_rad);
  place_.yaw_rad += rolled * std::tan(place_.steering_rad) / podcar_geometry.wheelbase_m;
  travelled_m_ += std::abs(rolled);

  counts_part_ += rolled / metres_a_count;
  const double counts = std::trunc(counts_part_);
  counts_part_ -= counts;
  senses.encoder_turned[podcar_wheel.encoder - 1] = static_cast<std::int32_t>(counts);

  // The potentiometer has noise of 10 mV.
  noise_ = noise_ * 6364136223846793005U + 1442695040888963407U;
  const auto noise_cv = static_cast<std::int32_t>(noise_ >> 33) % 3 - 1;
  const r4::control::SteeringSensor sensor(podcar_steering);
  senses.analog_cv[static_cast<int>(r4::Analog::ainsteer)] =
      static_cast<std::int32_t>(std::lround(100 * sensor.volts(place_.steering_rad))) + noise_cv;

  const double ahead_cm = 100 * (wall_x_m_ - place_.x_m - nose_m);
  senses.ultrasonic_cm[0] = static_cast<std::uint16_t>(
      ahead_cm > 0 && ahead_cm < r4::proximity_max_cm ? std::lround(ahead_cm) : 0);
}

double PodcarModel::braking_distance_m(double speed_m_s) {
  PodcarModel model;
  model.without_supply_ms_ = 0;
  model.place_.speed_m_s = speed_m_s;
  double distance_m = 0;
  while (model.place_.speed_m_s > 0) {
    model.move(0, false);
    distance_m += model.place_.speed_m_s * dt_s;
  }
  return distance_m;
}

double PodcarModel::coasting_distance_m(double speed_m_s) {
  PodcarModel model;
  model.place_.speed_m_s = speed_m_s;
  double distance_m = 0;
  while (model.place_.speed_m_s > 0) {
    model.move(0, true);
    distance_m += model.place_.speed_m_s * dt_s;
  }
  return distance_m;
}
