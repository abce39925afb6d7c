// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/drivers/analog.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <cmath>

namespace r4::firmware {
namespace {

TEST(Analog, TheDefaultFullRangeIs50Volts) {
  const AnalogCalibration calibration;
  EXPECT_EQ(centivolts_of(0, calibration), 0);
  EXPECT_EQ(centivolts_of(65535, calibration), 5000);
  EXPECT_EQ(centivolts_of(32768, calibration), 2500);
}

TEST(Analog, ExtrapolatesBeyondTheCalibrationPoints) {
  AnalogCalibration calibration;
  ASSERT_TRUE(calibration.set(1000, 50, 2000, 150));
  EXPECT_EQ(centivolts_of(0, calibration), -50);
  EXPECT_EQ(centivolts_of(500, calibration), 0);
}

TEST(Analog, RefusesACalibrationThatNoDividerCanHave) {
  AnalogCalibration calibration;
  const AnalogCalibration before = calibration;
  EXPECT_FALSE(calibration.set(100, 0, 100, 500));
  EXPECT_FALSE(calibration.set(100, 500, 200, 400));
  EXPECT_FALSE(calibration.set(100, 500, 200, 500));
  EXPECT_FALSE(calibration.set(100, 0, 101, 5000));
  EXPECT_EQ(calibration.gain_q24, before.gain_q24);
  EXPECT_EQ(calibration.offset_q8, before.offset_q8);
}

RC_GTEST_PROP(Analog, IsWithinAHundredthOfAVoltOfTheLineThroughTwoReadings, ()) {
  const auto counts_1 = *rc::gen::inRange<std::uint16_t>(0, 20000);
  const auto counts_2 = *rc::gen::inRange<std::uint16_t>(40000, 65535);
  const auto volts_1 = *rc::gen::inRange(0, 1500);
  const auto volts_2 = *rc::gen::inRange(1600, 5000);
  AnalogCalibration calibration;
  RC_ASSERT(calibration.set(counts_1, volts_1, counts_2, volts_2));
  const auto counts = *rc::gen::arbitrary<std::uint16_t>();
  const double exact = volts_1 + static_cast<double>(counts - counts_1) * (volts_2 - volts_1) /
                                     (counts_2 - counts_1);
  RC_ASSERT(std::abs(centivolts_of(counts, calibration) - exact) <= 1.0);
}

}  // namespace
}  // namespace r4::firmware
