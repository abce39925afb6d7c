// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/control/pid.hpp"

#include <algorithm>
#include <cmath>

#include "r4link/error.hpp"

namespace r4::control {

Pid::Pid(const PidOptions& options) : options_(options) {
  for (const double each : {options.kp, options.ki, options.kd, options.feed_forward,
                            options.minimum, options.maximum, options.derivative_filter_s}) {
    if (!std::isfinite(each)) {
      throw Error(ErrorKind::usage, "Pid", "an option is not a finite number",
                  "give gains, limits and the filter as numbers");
    }
  }
  if (options.minimum >= options.maximum) {
    throw Error(ErrorKind::usage, "Pid", "the minimum is not below the maximum",
                "give the range of the output, such as -1 and 1");
  }
  if (!(options.rate > 0) || options.derivative_filter_s < 0) {
    throw Error(ErrorKind::usage, "Pid", "the rate is not above 0, or the filter is below 0",
                "give valid values, or leave the rate and the filter out");
  }
  reset();
}

double Pid::limited(double output) const {
  return std::clamp(output, options_.minimum, options_.maximum);
}

void Pid::reset() {
  integral_ = derivative_ = 0;
  has_measured_ = false;
  output_ = limited(0);
}

void Pid::take_over(double output, double setpoint, double measured) {
  reset();
  output_ = limited(output);
  integral_ = output_ - options_.feed_forward * setpoint - options_.kp * (setpoint - measured);
  measured_ = measured;
  has_measured_ = true;
}

double Pid::step(double setpoint, double measured, double dt_s) {
  if (!std::isfinite(setpoint) || !std::isfinite(measured)) {
    throw Error(ErrorKind::data, "Pid", "the setpoint or the measured value is not a finite number",
                "check the calculation of both values");
  }
  if (!(dt_s > 0)) return output_;
  if (has_measured_) {
    const double weight = dt_s / (options_.derivative_filter_s + dt_s);
    derivative_ += weight * ((measured - measured_) / dt_s - derivative_);
  }
  measured_ = measured;
  has_measured_ = true;

  const double error = setpoint - measured;
  const double rest =
      options_.feed_forward * setpoint + options_.kp * error - options_.kd * derivative_;
  const double more = options_.ki * error * dt_s;
  const double wanted = rest + integral_ + more;
  const double most = options_.rate * dt_s;
  const double given = limited(std::clamp(wanted, output_ - most, output_ + most));
  // While the output is limited, the integral changes only towards the range.
  const bool held = (wanted > given && more > 0) || (wanted < given && more < 0);
  if (!held) integral_ += more;
  return output_ = given;
}

}  // namespace r4::control
