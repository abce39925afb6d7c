// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/ports/sim/simulated_hal.hpp"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "protocol/state.hpp"
#include "tests/support/datagrams.hpp"

namespace r4::sim {
namespace {

firmware::Inputs sample(SimulatedHal& hal) {
  firmware::Inputs inputs;
  hal.sample(inputs);
  return inputs;
}

// What a stepper is told.
firmware::Outputs stepper_to(std::int32_t position, std::int32_t speed, int channel = 1) {
  firmware::Outputs outputs;
  outputs.stepper[channel - 1].position = position;
  outputs.stepper[channel - 1].speed = speed;
  outputs.stepper[channel - 1].enabled = true;
  return outputs;
}

TEST(SimulatedHal, StandsOnTheBenchAsInTheCaptureAtFirst) {
  SimulatedHal hal(1);
  hal.power_on(0);
  const firmware::Inputs inputs = sample(hal);
  EXPECT_TRUE(inputs.handle_held);
  for (const std::uint16_t cm : inputs.ultrasonic_cm) EXPECT_EQ(cm, 0);
  for (const std::int32_t counts : inputs.encoder_counts) EXPECT_EQ(counts, 0);
  EXPECT_EQ(hal.outputs(), firmware::Outputs());
}

TEST(SimulatedHal, AnalogInputsTakeTheValuesOfTheCapture) {
  std::map<int, std::set<std::int32_t>> captured;
  for (const auto& line : test::paper_capture()) {
    Datagram datagram;
    State state;
    if (!line.from_board || !read(line.bytes, datagram) || !read_state(datagram, state)) continue;
    if (!state.present.has(StateField::ain24)) continue;
    for (int i = 0; i <= static_cast<int>(Analog::ainsteer); ++i) {
      captured[i].insert(state.analog_cv[i]);
    }
  }
  ASSERT_EQ(captured.size(), 5U);

  SimulatedHal hal(7);
  std::map<int, std::set<std::int32_t>> simulated;
  for (std::uint32_t t = 0; t < 10000; t += 10) {
    hal.advance(t);
    const firmware::Inputs inputs = sample(hal);
    for (int i = 0; i <= static_cast<int>(Analog::ainsteer); ++i) {
      simulated[i].insert(inputs.analog_cv[i]);
    }
    EXPECT_LE(inputs.analog_cv[static_cast<int>(Analog::ain6)], 2);
  }
  EXPECT_EQ(simulated, captured);
}

TEST(SimulatedHal, GivesTheSameInputsForTheSameSeedHoweverOftenItIsAsked) {
  SimulatedHal a(3);
  SimulatedHal b(3);
  SimulatedHal other(4);
  int differences = 0;
  for (std::uint32_t t = 0; t < 1000; t += 10) {
    a.advance(t);
    b.advance(t);
    other.advance(t);
    sample(b);
    const firmware::Inputs of_a = sample(a);
    const firmware::Inputs of_b = sample(b);
    for (int i = 0; i < analog_channels; ++i) {
      EXPECT_EQ(of_a.analog_cv[i], of_b.analog_cv[i]);
      if (of_a.analog_cv[i] != sample(other).analog_cv[i]) ++differences;
    }
  }
  EXPECT_GT(differences, 100);
}

TEST(SimulatedHal, TheHandlesVoltageFollowsTheHandle) {
  SimulatedHal hal(1);
  constexpr int aindmh = static_cast<int>(Analog::aindmh);
  EXPECT_GT(sample(hal).analog_cv[aindmh], 1100);
  hal.hold_handle(false);
  EXPECT_FALSE(sample(hal).handle_held);
  EXPECT_LT(sample(hal).analog_cv[aindmh], 10);
  hal.hold_handle(true);
  EXPECT_TRUE(sample(hal).handle_held);
  EXPECT_GT(sample(hal).analog_cv[aindmh], 1100);
}

TEST(SimulatedHal, APinnedAnalogInputStays) {
  SimulatedHal hal(1);
  hal.pin_analog(Analog::ain24, 2150);
  for (std::uint32_t t = 0; t < 100; ++t) {
    hal.advance(t);
    EXPECT_EQ(sample(hal).analog_cv[static_cast<int>(Analog::ain24)], 2150);
  }
}

TEST(SimulatedHal, AStepperMovesAtItsSpeedAndStopsAtItsTarget) {
  SimulatedHal hal(1);
  hal.power_on(1000);
  hal.apply(stepper_to(-100, 1000));
  hal.advance(1010);
  EXPECT_EQ(sample(hal).stepper_steps[0], -10);
  hal.advance(1099);
  EXPECT_EQ(sample(hal).stepper_steps[0], -99);
  hal.advance(1100);
  EXPECT_EQ(sample(hal).stepper_steps[0], -100);
  hal.advance(9999);
  EXPECT_EQ(sample(hal).stepper_steps[0], -100);
  EXPECT_EQ(sample(hal).stepper_steps[1], 0);
}

TEST(SimulatedHal, ASlowStepperLosesNoPartOfAStep) {
  SimulatedHal hal(1);
  hal.power_on(0);
  hal.apply(stepper_to(1000, 7, 3));
  for (std::uint32_t t = 1; t <= 10000; ++t) hal.advance(t);
  EXPECT_EQ(sample(hal).stepper_steps[2], 70);
}

TEST(SimulatedHal, AStepperCrossesTheWholeRange) {
  SimulatedHal hal(1);
  constexpr std::int32_t low = -0x7fffffff - 1;
  constexpr std::int32_t high = 0x7fffffff;
  hal.power_on(0);
  hal.apply(stepper_to(low, 20000));
  hal.advance(200'000'000);
  EXPECT_EQ(sample(hal).stepper_steps[0], low);
  hal.apply(stepper_to(high, 20000));
  hal.advance(600'000'000);
  EXPECT_EQ(sample(hal).stepper_steps[0], high);
}

TEST(SimulatedHal, ASafeStepperStaysWhereItIs) {
  SimulatedHal hal(1);
  hal.power_on(0);
  hal.apply(stepper_to(100, 1000));
  hal.advance(50);
  hal.make_safe();
  EXPECT_EQ(hal.outputs(), firmware::Outputs());
  hal.advance(5000);
  EXPECT_EQ(sample(hal).stepper_steps[0], 50);
}

TEST(SimulatedHal, ZeroCountsFromHereAndHoldsTheStepper) {
  SimulatedHal hal(1);
  hal.power_on(0);
  hal.apply(stepper_to(100, 1000, 2));
  hal.set_encoder(2, 1234);
  hal.set_encoder(1, 99);
  hal.advance(50);
  hal.zero(2);
  EXPECT_EQ(sample(hal).stepper_steps[1], 0);
  EXPECT_EQ(sample(hal).encoder_counts[1], 0);
  EXPECT_EQ(sample(hal).encoder_counts[0], 99);
  hal.advance(5000);
  EXPECT_EQ(sample(hal).stepper_steps[1], 0);
}

TEST(SimulatedHal, PowerOnStartsAfreshButTheSurroundingsStay) {
  SimulatedHal hal(1);
  hal.power_on(0);
  hal.apply(stepper_to(100, 1000));
  hal.set_encoder(1, 5);
  hal.hold_handle(false);
  hal.set_ultrasonic(4, 20);
  hal.advance(100);
  hal.power_on(77);
  EXPECT_EQ(hal.outputs(), firmware::Outputs());
  const firmware::Inputs inputs = sample(hal);
  EXPECT_EQ(inputs.stepper_steps[0], 0);
  EXPECT_EQ(inputs.encoder_counts[0], 0);
  EXPECT_FALSE(inputs.handle_held);
  EXPECT_EQ(inputs.ultrasonic_cm[3], 20);
}

}  // namespace
}  // namespace r4::sim
