// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/drivers/stepper.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include "pin_models.hpp"

namespace r4::firmware {
namespace {

constexpr std::int32_t tick_hz = 40000;

struct StepperBench {
  void tick(std::int64_t ticks) {
    for (std::int64_t i = 0; i < ticks; ++i) stepper.tick();
  }
  test::OutputPinModel step;
  test::OutputPinModel direction;
  Stepper stepper{step, direction, tick_hz, 20000};
};

TEST(Stepper, GoesToItsPositionAndStays) {
  StepperBench bench;
  bench.stepper.go(100, 1000);
  EXPECT_TRUE(bench.stepper.moving());
  bench.tick(tick_hz / 10 + 1);  // one tick is for the direction
  EXPECT_EQ(bench.stepper.position(), 100);
  EXPECT_TRUE(bench.direction.high);
  bench.tick(tick_hz);
  EXPECT_EQ(bench.stepper.position(), 100);
  EXPECT_EQ(bench.step.rises, 100);
  EXPECT_FALSE(bench.step.high);
  EXPECT_FALSE(bench.stepper.moving());
  bench.stepper.go(-50, 1000);
  bench.tick(tick_hz);
  EXPECT_EQ(bench.stepper.position(), -50);
  EXPECT_FALSE(bench.direction.high);
  EXPECT_EQ(bench.step.rises, 250);
}

TEST(Stepper, SpeedIsExactOverDays) {
  // The speed does not divide the rate of ticks. After three days no step may be missing.
  test::OutputPinModel step;
  test::OutputPinModel direction;
  Stepper stepper(step, direction, 200, 20000);
  stepper.go(1'000'000'000, 77);
  stepper.tick();
  const std::int32_t seconds = 3 * 86400;
  for (std::int32_t i = 0; i < 200 * seconds; ++i) stepper.tick();
  EXPECT_EQ(stepper.position(), 77 * seconds);
}

TEST(Stepper, SpeedIsLimited) {
  StepperBench bench;
  bench.stepper.go(1'000'000, 2'000'000'000);
  bench.tick(1 + tick_hz);
  EXPECT_EQ(bench.stepper.position(), 20000);
  test::OutputPinModel step;
  test::OutputPinModel direction;
  Stepper slow(step, direction, 1000, 20000);
  slow.go(1'000'000, 20000);
  for (int i = 0; i < 1001; ++i) slow.tick();
  EXPECT_EQ(slow.position(), 500);
  EXPECT_EQ(step.rises, 500);
}

TEST(Stepper, SetsTheDirectionOneTickBeforeTheStep) {
  StepperBench bench;
  bench.stepper.go(10, 20000);
  bench.tick(30);
  bench.stepper.go(-10, 20000);
  bool before = bench.direction.high;
  for (int i = 0; i < 60; ++i) {
    const int rises = bench.step.rises;
    bench.tick(1);
    EXPECT_TRUE(bench.step.rises == rises || bench.direction.high == before);
    before = bench.direction.high;
  }
  EXPECT_EQ(bench.stepper.position(), -10);
}

TEST(Stepper, StopCompletesTheCurrentStep) {
  StepperBench bench;
  bench.stepper.go(1000, 20000);
  while (!bench.step.high) bench.tick(1);
  const std::int32_t at = bench.stepper.position();
  bench.stepper.stop();
  bench.tick(1000);
  EXPECT_EQ(bench.stepper.position(), at);
  EXPECT_FALSE(bench.step.high);
}

TEST(Stepper, ZeroHoldsTheStepperAtItsPosition) {
  StepperBench bench;
  bench.stepper.go(1000, 20000);
  bench.tick(100);
  bench.stepper.zero();
  bench.tick(100);
  EXPECT_EQ(bench.stepper.position(), 0);
  EXPECT_FALSE(bench.stepper.moving());
  bench.stepper.go(3, 1000);
  bench.tick(tick_hz);
  EXPECT_EQ(bench.stepper.position(), 3);
}

TEST(Stepper, ASpeedOfZeroOrLessDoesNotMove) {
  StepperBench bench;
  for (const std::int32_t speed : {0, -1, -20000}) {
    bench.stepper.go(1000, speed);
    bench.tick(1000);
    EXPECT_EQ(bench.stepper.position(), 0);
  }
}

RC_GTEST_PROP(Stepper, ThePinsCountWhatThePositionSays, ()) {
  StepperBench bench;
  std::int32_t by_pins = 0;
  const auto legs = *rc::gen::inRange(1, 12);
  for (int leg = 0; leg < legs; ++leg) {
    bench.stepper.go(*rc::gen::inRange(-300, 300), *rc::gen::inRange(0, 25000));
    const auto ticks = *rc::gen::inRange(0, 2000);
    for (int i = 0; i < ticks; ++i) {
      const int rises = bench.step.rises;
      const bool was_high = bench.step.high;
      const bool direction = bench.direction.high;
      bench.tick(1);
      if (bench.step.rises == rises) continue;
      RC_ASSERT(direction == bench.direction.high);
      RC_ASSERT(!was_high);  // pulses do not merge
      by_pins += bench.direction.high ? 1 : -1;
    }
    RC_ASSERT(bench.stepper.position() == by_pins);
  }
}

}  // namespace
}  // namespace r4::firmware
