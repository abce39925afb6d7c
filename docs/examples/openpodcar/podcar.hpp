// SPDX-License-Identifier: GPL-3.0-or-later
// The vehicle: its channels, its controllers and its position. No I/O and no clock, so tests drive
// it as the program does.
//
//     OSMC 1    the motor of the rear axle, which turns encoder 1
//     DHB1A     the linear actuator of the steering; forward steers to the left
//     AINSTEER  the actuator's potentiometer
//     relay 1   the motors' supply, in series with the dead-man's handle; without supply the
//               parking brake holds
//     US 1      looks forward
#pragma once

#include <optional>
#include <r4link/control/kinematics.hpp>
#include <r4link/control/loop.hpp>
#include <r4link/control/odometry.hpp>
#include <r4link/control/pid.hpp>
#include <r4link/control/sensors.hpp>
#include <r4link/setpoints.hpp>
#include <r4link/state.hpp>

// The sizes of a mobility scooter (Shoprider Traverso). Measure your vehicle.
inline constexpr r4::control::Ackermann::Geometry podcar_geometry{
    .wheelbase_m = 1.05, .track_m = 0.55, .max_steering_rad = 0.5, .max_speed_m_s = 1.2};
inline constexpr r4::control::WheelGeometry podcar_wheel{
    .encoder = 1, .counts_a_turn = 2000, .radius_m = 0.165};
inline constexpr r4::control::SteeringSensor::Calibration podcar_steering{
    .left_volts = 1, .left_rad = 0.5, .right_volts = 4, .right_rad = -0.5};
inline constexpr const char* podcar_fields = "OSMC1,DHB1A,ENC1,AINSTEER,DMHSTA,US1";
// If US 1 sees a nearer obstacle, the board goes safe. The distance covers the quarter of a second
// until the sensor's next reading, and the braking distance.
inline constexpr int podcar_clearance_cm = 150;

// The fields and limits that run_loop() supervises.
r4::control::LoopOptions podcar_loop();

class Podcar {
 public:
  // Sets the position, before the first state.
  void begin_at(const r4::control::Pose& pose) { odometry_.reset(pose); }
  // After the board is armed: clears what the controllers learned in the previous drive.
  void begin_drive();
  // After the board has restarted: its counter begins at 0 without any movement.
  void on_restart() { wheel_.reset(); }
  // Uses each new state. False if the steering sensor is not plausible: then do not drive.
  bool sense(const r4::State& state);
  // The setpoints for this motion. Call sense() first.
  r4::Setpoints drive(const r4::control::Twist& wish, double dt_s);
  // True if the vehicle follows drive(). False if the steering does not follow for half a second,
  // or if the vehicle is much too fast, as with an encoder that counts backwards. If false, do
  // not drive.
  bool obeys() const;

  const r4::control::Pose& pose() const { return odometry_.pose(); }
  const r4::control::Odometry& odometry() const { return odometry_; }
  double speed_m_s() const { return wheel_.speed_m_s(); }
  double steering_rad() const { return steering_rad_; }
  double turn_rad_s() const { return car_.twist({speed_m_s(), steering_rad_}).turn_rad_s; }

 private:
  r4::control::Ackermann car_{podcar_geometry};
  r4::control::Wheel wheel_{podcar_wheel};
  r4::control::SteeringSensor sensor_{podcar_steering};
  r4::control::Odometry odometry_;
  // 2.5 m/s at full duty, after 0.8 s; docs/how-to/control.md, Tuning.
  r4::control::Pid speed_{{.kp = 0.9, .ki = 1.1, .feed_forward = 0.16, .rate = 2}};
  // The actuator is an integrator, so a proportional controller is enough.
  r4::control::Pid steering_{{.kp = 30, .rate = 20}};
  double steering_rad_ = 0;
  double stuck_at_rad_ = 0,
         stuck_s_ =
             0;  // the angle at which the driven steering does not move, and for how long
};
