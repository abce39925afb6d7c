// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/control/sensors.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "r4link/error.hpp"

namespace r4::control {

Wheel::Wheel(const WheelGeometry& geometry, std::uint32_t window_ms, double max_speed_m_s)
    : geometry_(geometry),
      window_ms_(window_ms),
      max_speed_m_s_(max_speed_m_s),
      metres_a_count_(2 * std::numbers::pi * geometry.radius_m / geometry.counts_a_turn *
                      (geometry.reversed ? -1 : 1)) {
  if (geometry.encoder < 1 || geometry.encoder > encoder_channels) {
    throw Error(ErrorKind::usage, "Wheel", "the encoder does not exist", "give 1 to 4");
  }
  if (!(geometry.counts_a_turn > 0) || !(geometry.radius_m > 0) || !(max_speed_m_s > 0) ||
      window_ms == 0) {
    throw Error(ErrorKind::usage, "Wheel",
                "counts a turn, radius, window or largest speed is not above 0",
                "give counts, metres, milliseconds and metres a second");
  }
}

void Wheel::reset() {
  count_ = 0;
  speed_m_s_ = 0;
}

double Wheel::advance(const State& state) {
  const Sample now{state.t_ms, state.encoder(geometry_.encoder)};
  if (count_ != 0 && samples_[newest_].t_ms == now.t_ms) return 0;
  const auto metres_since = [&](const Sample& then) {  // the counts wrap
    return static_cast<std::int32_t>(static_cast<std::uint32_t>(now.counts) -
                                     static_cast<std::uint32_t>(then.counts)) *
           metres_a_count_;
  };
  double rolled_m = 0;
  if (count_ != 0) {
    // Below 0 if the board has restarted.
    const auto elapsed_ms = static_cast<std::int32_t>(now.t_ms - samples_[newest_].t_ms);
    rolled_m = metres_since(samples_[newest_]);
    if (elapsed_ms < 0 || std::abs(rolled_m) > max_speed_m_s_ * elapsed_ms / 1000.0) {
      reset();
      rolled_m = 0;
    }
  }
  newest_ = (newest_ + 1) % most_samples;
  samples_[newest_] = now;
  count_ = std::min(count_ + 1, most_samples);
  // The newest sample that is at least a window old, else the oldest sample.
  for (std::size_t back = 1; back < count_; ++back) {
    const Sample& then = samples_[(newest_ + most_samples - back) % most_samples];
    const std::uint32_t age_ms = now.t_ms - then.t_ms;
    if (age_ms < window_ms_ && back + 1 < count_) continue;
    speed_m_s_ = metres_since(then) * 1000.0 / age_ms;
    break;
  }
  return rolled_m;
}

double Wheel::measured_m_s(const State& state) const {
  return state.raw.encoder_hz[geometry_.encoder - 1] * metres_a_count_;
}

SteeringSensor::SteeringSensor(const Calibration& calibration) : calibration_(calibration) {
  const bool apart = std::abs(calibration.left_volts - calibration.right_volts) > 0.01 &&
                     calibration.left_rad > calibration.right_rad;
  if (apart && calibration.margin_volts >= 0) return;
  throw Error(ErrorKind::usage, "SteeringSensor", "the two ends have the same angle or voltage",
              "steer to the left and to the right, and give both angles with their voltages");
}

std::optional<double> SteeringSensor::angle_rad(const State& state) const {
  const Calibration& at = calibration_;
  const double volts = state.volts(Analog::ainsteer);
  const auto [low, high] = std::minmax(at.left_volts, at.right_volts);
  if (volts < low - at.margin_volts || volts > high + at.margin_volts) return std::nullopt;
  const double share = (volts - at.right_volts) / (at.left_volts - at.right_volts);
  return at.right_rad + share * (at.left_rad - at.right_rad);
}

double SteeringSensor::volts(double angle_rad) const {
  const Calibration& at = calibration_;
  const double share = (angle_rad - at.right_rad) / (at.left_rad - at.right_rad);
  return at.right_volts + share * (at.left_volts - at.right_volts);
}

}  // namespace r4::control
