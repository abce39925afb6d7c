// SPDX-License-Identifier: GPL-3.0-or-later
// Encoders and the steering sensor of a robot, in metres, metres per second and radians.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "../config.hpp"
#include "../state.hpp"

namespace r4::control {

struct WheelGeometry {
  int encoder = 1;           // 1-4
  double counts_a_turn = 0;  // of the wheel: counts of the encoder times the gear ratio
  double radius_m = 0;
  bool reversed = false;  // counts down when the robot moves forward
};

// A wheel with an encoder. Pass each state to advance(), in order.
class R4LINK_API Wheel {
 public:
  // `window_ms`: averaging time of speed_m_s(), above 0. A speed above `max_speed_m_s` counts as a
  // restarted board or a zeroed encoder, not as motion. Throws Error{usage} for an encoder outside
  // 1-4, and for a radius, counts, limit or window that is not above 0.
  explicit Wheel(const WheelGeometry& geometry, std::uint32_t window_ms = 50,
                 double max_speed_m_s = 20);

  // The distance in m since the previous state, from ENCn; 0 in the first call.
  double advance(const State& state);
  // The speed over the last window, so it is half a window old. Needs ENCn in each state.
  double speed_m_s() const { return speed_m_s_; }
  // The speed from ENCnHZ: updated ten times a second, 50 to 150 ms old. Needs only this state.
  double measured_m_s(const State& state) const;
  double metres_a_count() const { return metres_a_count_; }
  int encoder() const { return geometry_.encoder; }
  void reset();

 private:
  struct Sample {
    std::uint32_t t_ms = 0;
    std::int32_t counts = 0;
  };
  static constexpr std::size_t most_samples = 64;

  WheelGeometry geometry_;
  std::uint32_t window_ms_;
  double max_speed_m_s_;
  double metres_a_count_;
  std::array<Sample, most_samples> samples_{};  // a ring, the newest at newest_
  std::size_t newest_ = 0;
  std::size_t count_ = 0;
  double speed_m_s_ = 0;
};

// The steering angle from AINSTEER: linear between two angles with measured voltages.
class R4LINK_API SteeringSensor {
 public:
  struct Calibration {
    double left_volts = 0;   // at left_rad
    double left_rad = 0;     // above right_rad
    double right_volts = 0;  // at right_rad
    double right_rad = 0;
    // A voltage farther outside means an unplugged cable or a broken sensor.
    double margin_volts = 0.3;
  };
  // Throws Error{usage} unless the voltages differ by more than 0.01 V, left_rad is above
  // right_rad, and margin_volts is not negative.
  explicit SteeringSensor(const Calibration& calibration);

  // Empty if the voltage is impossible: then do not steer, and do not drive.
  std::optional<double> angle_rad(const State& state) const;
  double volts(double angle_rad) const;

 private:
  Calibration calibration_;
};

}  // namespace r4::control
