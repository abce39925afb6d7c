// SPDX-License-Identifier: GPL-3.0-or-later
// A model of the vehicle, for a simulated board (docs/how-to/simulation.md, Tests of your own
// robot): mass, motor, brake, steering actuator with its potentiometer, wheels, encoder, and the
// distance that the front sensor measures. The wheels do not slip.
#pragma once

#include <cstdint>
#include <r4link/simulation/simulated_pins.hpp>

struct PodcarPlace {
  double x_m = 0;  // of the middle of the rear axle
  double y_m = 0;
  double yaw_rad = 0;
  double speed_m_s = 0;
  double steering_rad = 0;
};

class PodcarModel final : public r4::sim::RobotModel {
 public:
  static constexpr double mass_kg = 130;        // with a load
  static constexpr double top_speed_m_s = 2.5;  // without load, at full duty
  static constexpr double stall_force_n = 400;  // of the motor at the rims, at full duty
  static constexpr double rolling_force_n = 20;
  static constexpr double brake_force_n =
      300;  // of the parking brake, which holds without supply
  static constexpr int brake_delay_ms = 30;
  static constexpr double steering_rad_s = 0.3;  // of the actuator at full duty
  static constexpr double steering_lag_s = 0.05;
  static constexpr double nose_m = 1.3;  // from the rear axle to the sensor in front

  explicit PodcarModel(std::uint64_t seed = 1) : noise_(seed) {}

  void pass_millisecond(const r4::sim::ChipPins& pins, bool motors_have_supply,
                        Senses& senses) override;

  // Must not run while another thread calls pass_millisecond().
  const PodcarPlace& place() const { return place_; }
  void put(const PodcarPlace& place) { place_ = place; }
  // A wall across the x axis, for a vehicle that drives along the x axis.
  void set_wall(double x_m) { wall_x_m_ = x_m; }
  double travelled_m() const { return travelled_m_; }

  // Braking distance if the supply is cut.
  static double braking_distance_m(double speed_m_s);
  // Braking distance with supply and duty 0: the motor is shorted.
  static double coasting_distance_m(double speed_m_s);

 private:
  void move(double duty, bool supplied);
  void steer(double duty);

  PodcarPlace place_;
  double steering_speed_ = 0;
  double travelled_m_ = 0;
  double counts_part_ = 0;
  int without_supply_ms_ = 1000;
  double wall_x_m_ = 1e9;
  std::uint64_t noise_;
};
