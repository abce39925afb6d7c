// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/control/sensors.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <numbers>

#include "r4link/error.hpp"

namespace r4::control {
namespace {

constexpr WheelGeometry metre_wheel{// 1000 counts a metre
                                    .encoder = 2,
                                    .counts_a_turn = 1000,
                                    .radius_m = 0.5 / std::numbers::pi};

State seen(std::uint32_t t_ms, std::int32_t counts) {
  State state;
  state.t_ms = t_ms;
  state.raw.encoder_counts[1] = counts;
  return state;
}

TEST(Wheel, SumsUpTheRolledDistance) {
  Wheel wheel(metre_wheel);
  EXPECT_EQ(wheel.advance(seen(1000, 500)), 0) << "the first state has no earlier position";
  EXPECT_NEAR(wheel.advance(seen(1010, 510)), 0.010, 1e-12);
  EXPECT_EQ(wheel.advance(seen(1010, 510)), 0) << "a second part of one state must not count twice";
  EXPECT_NEAR(wheel.advance(seen(1030, 490)), -0.020, 1e-12);
  WheelGeometry other_way = metre_wheel;
  other_way.reversed = true;
  Wheel reversed(other_way);
  reversed.advance(seen(0, 0));
  EXPECT_NEAR(reversed.advance(seen(10, 10)), -0.010, 1e-12);
}

TEST(Wheel, FollowsCountsAndTimeOverAWrap) {
  Wheel wheel(metre_wheel);
  wheel.advance(seen(0xFFFFFFFB, std::numeric_limits<std::int32_t>::max()));
  EXPECT_NEAR(wheel.advance(seen(5, std::numeric_limits<std::int32_t>::min() + 9)), 0.010, 1e-12);
  EXPECT_NEAR(wheel.speed_m_s(), 1.0, 1e-9);
}

TEST(Wheel, RestartsAfterARestartOfTheBoard) {
  Wheel wheel(metre_wheel);
  wheel.advance(seen(600'000, 90'000));
  EXPECT_EQ(wheel.advance(seen(3'000, 0)), 0);
  EXPECT_EQ(wheel.speed_m_s(), 0);
  EXPECT_NEAR(wheel.advance(seen(3'010, 10)), 0.010, 1e-12);
}

TEST(Wheel, IgnoresAJumpOfTheCount) {
  Wheel wheel(metre_wheel);
  wheel.advance(seen(0, 100'000));
  EXPECT_NEAR(wheel.advance(seen(10, 100'010)), 0.010, 1e-12);
  EXPECT_EQ(wheel.advance(seen(20, 0)), 0);
  EXPECT_EQ(wheel.speed_m_s(), 0);
  EXPECT_NEAR(wheel.advance(seen(30, 20)), 0.020, 1e-12);
  EXPECT_NEAR(wheel.speed_m_s(), 2.0, 1e-9);
}

TEST(Wheel, ReportsItsSpeedOverTheLastWindow) {
  Wheel wheel(metre_wheel, 50);
  std::int32_t counts = 0;
  for (std::uint32_t t_ms = 0; t_ms <= 200; t_ms += 10) wheel.advance(seen(t_ms, counts += 20));
  EXPECT_NEAR(wheel.speed_m_s(), 2.0, 1e-9);
  for (std::uint32_t t_ms = 210; t_ms <= 250; t_ms += 10) wheel.advance(seen(t_ms, counts));
  EXPECT_NEAR(wheel.speed_m_s(), 0, 1e-9) << "values older than the window must not count";
  State state = seen(0, 0);
  state.raw.encoder_hz[1] = -1500;
  EXPECT_NEAR(wheel.measured_m_s(state), -1.5, 1e-9);
}

TEST(SteeringSensor, HasAnAngleOnlyBetweenItsEnds) {
  const SteeringSensor sensor(
      {.left_volts = 4, .left_rad = 0.6, .right_volts = 1, .right_rad = -0.5, .margin_volts = 0.2});
  const auto at = [&](std::int32_t centivolts) {
    State state;
    state.raw.analog_cv[static_cast<int>(Analog::ainsteer)] = centivolts;
    return sensor.angle_rad(state);
  };
  EXPECT_NEAR(*at(400), 0.6, 1e-9);
  EXPECT_NEAR(*at(100), -0.5, 1e-9);
  EXPECT_NEAR(*at(250), 0.05, 1e-9);
  EXPECT_TRUE(at(85).has_value() && at(415).has_value());
  EXPECT_FALSE(at(0).has_value()) << "a value at the limit means a disconnected cable";
  EXPECT_FALSE(at(500).has_value());
  EXPECT_NEAR(sensor.volts(0.05), 2.5, 1e-9);
}

TEST(ControlSensors, RefuseImpossibleGeometry) {
  EXPECT_THROW(Wheel({.encoder = 5, .counts_a_turn = 1, .radius_m = 1}), Error);
  EXPECT_THROW(Wheel({.encoder = 1, .counts_a_turn = 0, .radius_m = 1}), Error);
  EXPECT_THROW(SteeringSensor({.left_volts = 1, .left_rad = 1, .right_volts = 1}), Error);
}

}  // namespace
}  // namespace r4::control
