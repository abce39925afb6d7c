// SPDX-License-Identifier: GPL-3.0-or-later
// r4::control::Pid: PID control of one value, with the time as an argument.
//     r4::control::Pid speed({.kp = 0.4, .ki = 1.6, .feed_forward = 0.5, .rate = 8});
//     const double duty = speed.step(wanted_m_s, is_m_s, dt_s);
//
// The output is the sum of
//     feed_forward * setpoint       the right output for a perfect model
//     kp * error                    error = setpoint - measured
//     ki * integral of the error    held while the output cannot follow the error (anti-windup)
//     -kd * d(measured)/dt          low-pass filtered; a step of the setpoint causes no kick
//
// limited in value and rate (Astrom and Murray, Feedback Systems, 2nd ed., chapter 11). Setpoint
// and measured value have the same unit; the output may have another unit. No clock, no heap.
#pragma once

#include <limits>

#include "../config.hpp"

namespace r4::control {

struct PidOptions {
  double kp = 0;            // output per unit of error
  double ki = 0;            // output per unit of error and second
  double kd = 0;            // output per unit per second
  double feed_forward = 0;  // output per unit of setpoint
  double minimum = -1;      // of the output
  double maximum = 1;
  double rate = std::numeric_limits<double>::infinity();  // per second, up and down
  double derivative_filter_s = 0;  // time constant of the derivative's low-pass filter; 0: none
};

class R4LINK_API Pid {
 public:
  // Throws Error{usage} if a gain, limit or filter is not finite, minimum >= maximum, the rate is
  // not above 0, or the filter is negative.
  explicit Pid(const PidOptions& options);

  // The output, `dt_s` seconds after the last step. If dt_s is not above 0, the output is
  // unchanged. Throws Error{data} for a value that is not finite.
  double step(double setpoint, double measured, double dt_s);
  double output() const { return output_; }
  // The integral term, in units of the output.
  double integral() const { return integral_; }

  // Resets all: the output becomes 0, or the limit nearest to 0.
  void reset();
  // Continues without a jump from the output of another controller: sets the integral.
  void take_over(double output, double setpoint, double measured);

 private:
  double limited(double output) const;

  PidOptions options_;
  double integral_ = 0;
  double derivative_ = 0;
  double measured_ = 0;  // of the last step
  bool has_measured_ = false;
  double output_ = 0;
};

}  // namespace r4::control
