// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/control/pid.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "r4link/error.hpp"

namespace r4::control {
namespace {

TEST(Pid, AddsItsTermsUp) {
  Pid pid({.kp = 0.5, .ki = 2, .feed_forward = 0.1, .minimum = -10, .maximum = 10});
  EXPECT_DOUBLE_EQ(pid.step(4, 3, 0.1), 0.4 + 0.5 + 0.2);
  EXPECT_DOUBLE_EQ(pid.step(4, 3, 0.1), 0.4 + 0.5 + 0.4);
  EXPECT_DOUBLE_EQ(pid.integral(), 0.4);
  EXPECT_DOUBLE_EQ(pid.step(4, 3, 0), 0.4 + 0.5 + 0.4) << "no time has passed";
}

TEST(Pid, DoesNotWindUpWhileTheOutputIsAtItsLimit) {
  Pid pid({.kp = 1, .ki = 10});
  for (int i = 0; i < 1000; ++i) EXPECT_EQ(pid.step(5, 0, 0.01), 1);
  // The output must leave the limit at once, so the integral must not grow at the limit.
  EXPECT_LT(pid.step(5, 5.5, 0.01), 0);
  for (int i = 0; i < 1000; ++i) EXPECT_EQ(pid.step(-5, 0, 0.01), -1);
  EXPECT_GT(pid.step(-5, -5.5, 0.01), 0);
}

TEST(Pid, ChangesItsOutputNoFasterThanItsRate) {
  Pid pid({.kp = 1, .ki = 1, .rate = 2});
  EXPECT_DOUBLE_EQ(pid.step(1, 0, 0.1), 0.2);
  EXPECT_DOUBLE_EQ(pid.step(1, 0, 0.1), 0.4);
  EXPECT_DOUBLE_EQ(pid.integral(), 0)
      << "the integral must not grow while the rate limits the output";
  EXPECT_DOUBLE_EQ(pid.step(-1, 0, 0.05), 0.3);
}

TEST(Pid, TakesTheDerivativeOfTheMeasuredValueAndSmoothsIt) {
  Pid pid({.kd = 0.1, .minimum = -10, .maximum = 10});
  EXPECT_EQ(pid.step(0, 1, 0.1), 0) << "one value has no slope";
  EXPECT_EQ(pid.step(100, 1, 0.1), 0) << "a new setpoint must not change the output suddenly";
  EXPECT_DOUBLE_EQ(pid.step(100, 3, 0.1), -2);

  Pid smooth({.kd = 0.1, .minimum = -10, .maximum = 10, .derivative_filter_s = 0.3});
  smooth.step(0, 1, 0.1);
  EXPECT_DOUBLE_EQ(smooth.step(0, 3, 0.1), -0.5)
      << "a quarter of the slope, because 0.1 s is a quarter of 0.4 s";
}

TEST(Pid, TakeOverDoesNotChangeTheOutput) {
  Pid pid({.kp = 0.5, .ki = 1, .feed_forward = 0.2});
  pid.take_over(0.7, 2, 1.8);
  EXPECT_NEAR(pid.step(2, 1.8, 1e-6), 0.7, 1e-6);
  pid.reset();
  EXPECT_EQ(pid.output(), 0);
  EXPECT_EQ(pid.integral(), 0);
}

TEST(Pid, RefusesValuesThatAreNotFinite) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Pid pid({.kp = 1});
  pid.step(0.3, 0, 0.1);
  EXPECT_THROW(pid.step(nan, 0, 0.1), Error);
  EXPECT_THROW(pid.step(0, std::numeric_limits<double>::infinity(), 0.1), Error);
  EXPECT_DOUBLE_EQ(pid.step(0.3, 0, nan), 0.3) << "an unknown time counts as no time";
  EXPECT_THROW(Pid({.kp = nan}), Error);
  EXPECT_THROW(Pid({.minimum = 1, .maximum = 1}), Error);
  EXPECT_THROW(Pid({.rate = 0}), Error);
  EXPECT_THROW(Pid({.derivative_filter_s = -1}), Error);
}

}  // namespace
}  // namespace r4::control
