// SPDX-License-Identifier: GPL-3.0-or-later
// The chip drivers on the model of the board: the effect of each output, in virtual time.
#include "firmware/ports/sim/simulated_hardware.hpp"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "protocol/messages/state_fields.hpp"
#include "r4link/state.hpp"
#include "tests/support/datagrams.hpp"

namespace r4::sim {
namespace {

struct HardwareBench {
  explicit HardwareBench(std::uint64_t seed = 1) : board(seed) {
    board.power_on();
    hardware.power_up();
  }
  void run(int ms) {
    for (int i = 0; i < ms; ++i) hardware.pass_millisecond();
  }
  firmware::Inputs sample() {
    firmware::Inputs inputs;
    hardware.hal().sample(inputs);
    return inputs;
  }
  std::int32_t volts(Analog input) { return sample().analog_cv[static_cast<int>(input)]; }
  // The mean over one second, in hundredths of a volt.
  std::int32_t mean(Analog input) {
    std::int32_t sum = 0;
    for (int i = 0; i < 100; ++i) {
      run(10);
      sum += volts(input);
    }
    return sum / 100;
  }

  BoardModel board;
  SimulatedHardware hardware{board};
};

firmware::Outputs stepper_to(std::int32_t position, std::int32_t speed, int channel = 1) {
  firmware::Outputs outputs;
  outputs.stepper[channel - 1].position = position;
  outputs.stepper[channel - 1].speed = speed;
  outputs.stepper[channel - 1].enabled = true;
  return outputs;
}

// Relay 1 closes the supply of the motors.
firmware::Outputs supplied() {
  firmware::Outputs outputs;
  outputs.relays = 1;
  return outputs;
}

firmware::Outputs osmc(int channel, std::uint16_t pwm, Direction direction) {
  firmware::Outputs outputs = supplied();
  outputs.osmc[channel - 1] = Drive{pwm, direction};
  return outputs;
}

TEST(SimulatedHardware, StartsWithTheInputsOfTheCapture) {
  HardwareBench bench;
  EXPECT_TRUE(bench.hardware.hal().ready());
  EXPECT_FALSE(bench.hardware.hal().fault().any());
  EXPECT_TRUE(bench.board.pins().is_safe());
  bench.run(250);
  const firmware::Inputs inputs = bench.sample();
  EXPECT_TRUE(inputs.handle_held());
  EXPECT_EQ(inputs.ultrasonic_blind, 0);
  for (const std::uint16_t cm : inputs.ultrasonic_cm) EXPECT_EQ(cm, 0);
  for (const std::int32_t counts : inputs.encoder_counts) EXPECT_EQ(counts, 0);
}

TEST(SimulatedHardware, AnalogInputsTakeTheValuesOfTheCapture) {
  std::map<int, std::set<std::int32_t>> captured;
  for (const auto& line : test::paper_capture()) {
    Datagram datagram;
    State state;
    if (!line.from_board || !read_datagram(line.bytes, datagram) || !read_state(datagram, state))
      continue;
    if (!state.present.has(StateField::ain24)) continue;
    for (int i = 0; i <= static_cast<int>(Analog::ainsteer); ++i) {
      captured[i].insert(state.raw.analog_cv[i]);
    }
  }
  ASSERT_EQ(captured.size(), 5U);

  HardwareBench bench(7);
  std::map<int, std::set<std::int32_t>> simulated;
  for (int i = 0; i < 1000; ++i) {
    bench.run(10);
    const firmware::Inputs inputs = bench.sample();
    for (int j = 0; j <= static_cast<int>(Analog::ainsteer); ++j) {
      simulated[j].insert(inputs.analog_cv[j]);
    }
    EXPECT_LE(inputs.analog_cv[static_cast<int>(Analog::ain6)], 2);
  }
  EXPECT_EQ(simulated, captured);
}

TEST(SimulatedHardware, GivesTheSameInputsForTheSameSeed) {
  HardwareBench a(3);
  HardwareBench b(3);
  HardwareBench other(4);
  int differences = 0;
  for (int t = 0; t < 100; ++t) {
    a.run(10);
    b.run(10);
    other.run(10);
    b.sample();
    const firmware::Inputs of_a = a.sample();
    const firmware::Inputs of_b = b.sample();
    const firmware::Inputs of_other = other.sample();
    for (int i = 0; i < analog_channels; ++i) {
      EXPECT_EQ(of_a.analog_cv[i], of_b.analog_cv[i]);
      if (of_a.analog_cv[i] != of_other.analog_cv[i]) ++differences;
    }
  }
  EXPECT_GT(differences, 100);
}

TEST(SimulatedHardware, TheHandlesVoltageFollowsTheHandle) {
  HardwareBench bench;
  EXPECT_GT(bench.volts(Analog::aindmh), 1100);
  bench.board.hold_handle(false);
  EXPECT_FALSE(bench.sample().handle_held());
  EXPECT_LT(bench.volts(Analog::aindmh), 10);
  bench.board.hold_handle(true);
  EXPECT_FALSE(bench.sample().handle_held());  // the button may bounce
  bench.run(30);
  EXPECT_TRUE(bench.sample().handle_held());
  EXPECT_GT(bench.volts(Analog::aindmh), 1100);
}

TEST(SimulatedHardware, APinnedAnalogInputStaysWithinTheRangeOfItsDivider) {
  HardwareBench bench;
  bench.board.pin_analog(Analog::ain24, 2150);
  bench.board.pin_analog(Analog::ain12, 2'000'000'000);
  bench.board.pin_analog(Analog::ain5, -100);
  for (int t = 0; t < 100; ++t) {
    bench.run(1);
    EXPECT_EQ(bench.volts(Analog::ain24), 2150);
    EXPECT_EQ(bench.volts(Analog::ain12), 5000);
    EXPECT_EQ(bench.volts(Analog::ain5), 0);
  }
}

// --- steppers

TEST(SimulatedHardware, AStepperMovesAtItsSpeedAndStopsAtItsTarget) {
  HardwareBench bench;
  bench.hardware.hal().apply(stepper_to(-100, 1000));
  bench.run(50);
  EXPECT_NEAR(bench.sample().stepper_steps[0], -50, 1);
  EXPECT_EQ(bench.board.pins().stepper[0].stepping, -1);
  bench.run(52);
  EXPECT_EQ(bench.sample().stepper_steps[0], -100);
  bench.run(9999);
  EXPECT_EQ(bench.sample().stepper_steps[0], -100);
  EXPECT_EQ(bench.sample().stepper_steps[1], 0);
  EXPECT_EQ(bench.board.pins().stepper[0].position, -100);
  EXPECT_EQ(bench.board.pins().stepper[0].stepping, 0);
}

// --- motors

TEST(SimulatedHardware, NoMotorTurnsWithoutSupply) {
  HardwareBench bench;
  firmware::Outputs outputs = osmc(1, 4095, Direction::forward);
  outputs.dhb12[0] = Drive{4095, Direction::reverse};
  outputs.stepper[0].position = 1000;
  outputs.stepper[0].speed = 10000;
  outputs.stepper[0].enabled = true;
  const std::int32_t idle = bench.mean(Analog::ain24);
  const std::int32_t straight = bench.mean(Analog::ainsteer);
  const auto expect_that_all_stand = [&] {
    EXPECT_FALSE(bench.board.motors_have_supply());
    const std::int32_t counts = bench.sample().encoder_counts[0];
    const std::int32_t steps = bench.board.stepper_shaft(1);
    bench.run(1000);
    EXPECT_EQ(bench.sample().encoder_counts[0], counts);
    EXPECT_EQ(bench.board.stepper_shaft(1), steps);
  };

  outputs.relays = 0xFE;  // all but relay 1
  bench.hardware.hal().apply(outputs);
  expect_that_all_stand();
  EXPECT_EQ(bench.board.pins().osmc[0].pwm, 4095) << "the driver has the command";
  EXPECT_EQ(bench.board.pins().stepper[0].position, 1000) << "the stepper has it, too";
  EXPECT_NEAR(bench.mean(Analog::ain24), idle, 5);
  EXPECT_NEAR(bench.mean(Analog::ainsteer), straight, 5);

  outputs.relays = 1;
  outputs.stepper[0].position = 0;
  bench.hardware.hal().apply(outputs);
  bench.run(1000);
  EXPECT_TRUE(bench.board.motors_have_supply());
  EXPECT_GT(bench.sample().encoder_counts[0], 2000);
  EXPECT_EQ(bench.board.stepper_shaft(1), -1000);
  EXPECT_GT(bench.mean(Analog::ainsteer), straight + 100);

  // The handle's button cuts the supply itself: here no command switches the motors off.
  bench.board.hold_handle(false);
  bench.run(4000);  // the motor has stopped by this time
  expect_that_all_stand();
}

TEST(SimulatedHardware, AMotorTurnsItsEncoderInProportionToItsDuty) {
  HardwareBench bench;
  bench.hardware.hal().apply(osmc(2, 2048, Direction::forward));
  bench.run(2000);  // the motor has its full speed by this time
  const std::int32_t before = bench.sample().encoder_counts[1];
  bench.run(1000);
  EXPECT_NEAR(bench.sample().encoder_counts[1] - before, 2000, 5);
  EXPECT_NEAR(bench.sample().encoder_hz[1], 2000, 20);
  EXPECT_EQ(bench.sample().encoder_counts[0], 0);

  bench.hardware.hal().apply(osmc(2, 4095, Direction::reverse));
  bench.run(3000);
  const firmware::Inputs inputs = bench.sample();
  EXPECT_NEAR(inputs.encoder_hz[1], -4000, 20);
  EXPECT_EQ(inputs.encoder_index_counts[1] % 1000, 0);
  const std::int32_t beyond = inputs.encoder_index_counts[1] - inputs.encoder_counts[1];
  EXPECT_TRUE(beyond >= 0 && beyond < 1000) << beyond;
}

TEST(SimulatedHardware, AMotorCoastsToAStopInTheSafeState) {
  HardwareBench bench;
  bench.hardware.hal().apply(osmc(1, 4095, Direction::forward));
  bench.run(2000);
  bench.hardware.hal().make_safe();
  bench.run(5000);
  const std::int32_t counts = bench.sample().encoder_counts[0];
  bench.run(1000);
  EXPECT_EQ(bench.sample().encoder_counts[0], counts);
}

TEST(SimulatedHardware, TheBatterySagsMostWhenAMotorStarts) {
  HardwareBench bench;
  const std::int32_t idle = bench.mean(Analog::ain24);
  bench.hardware.hal().apply(osmc(1, 4095, Direction::forward));
  bench.run(5);
  const std::int32_t starting = bench.volts(Analog::ain24);
  bench.run(3000);
  EXPECT_LT(starting, idle - 30);
  EXPECT_NEAR(bench.mean(Analog::ain24), idle, 10);
}

TEST(SimulatedHardware, TheSteeringMotorMovesTheSteeringFromEndToEnd) {
  HardwareBench bench;
  EXPECT_NEAR(bench.mean(Analog::ainsteer), 100, 10);
  firmware::Outputs outputs = supplied();
  outputs.dhb12[0] = Drive{4095, Direction::reverse};
  bench.hardware.hal().apply(outputs);
  bench.run(750);
  EXPECT_NEAR(bench.volts(Analog::ainsteer), 250, 25);
  bench.run(5000);
  EXPECT_NEAR(bench.mean(Analog::ainsteer), 400, 10);
  outputs.dhb12[0] = Drive{4095, Direction::forward};
  bench.hardware.hal().apply(outputs);
  EXPECT_NEAR((bench.run(2000), bench.mean(Analog::ainsteer)), 100, 10);
}

TEST(SimulatedHardware, AnEncoderCanBeTurnedByHandToAnyCount) {
  HardwareBench bench;
  bench.board.turn_encoder(2, 2500);
  bench.board.turn_encoder(3, -0x7fffffff - 1);
  bench.run(2);
  EXPECT_EQ(bench.sample().encoder_counts[1], 2000);
  bench.run(1);
  EXPECT_EQ(bench.sample().encoder_counts[1], 2500);
  bench.run(10);
  EXPECT_EQ(bench.sample().encoder_counts[1], 2500);
  EXPECT_EQ(bench.sample().encoder_index_counts[1], 2000);
  EXPECT_EQ(bench.sample().encoder_counts[2], -13000);
  EXPECT_EQ(bench.sample().encoder_index_counts[2], -13000);
}

// --- ultrasonic sensors

TEST(SimulatedHardware, EachSensorMeasuresInItsTurn) {
  HardwareBench bench;
  for (int channel = 1; channel <= ultrasonic_channels; ++channel) {
    bench.board.set_ultrasonic(channel, static_cast<std::uint16_t>(100 * channel));
  }
  bench.run(2 * 245);
  for (int i = 0; i < ultrasonic_channels; ++i) {
    EXPECT_EQ(bench.sample().ultrasonic_cm[i], 100 * (i + 1));
  }
  EXPECT_EQ(bench.sample().ultrasonic_blind, 0);
}

TEST(SimulatedHardware, ASensorWithoutItsCableIsBlind) {
  HardwareBench bench;
  bench.board.set_ultrasonic(3, 42);
  bench.run(500);
  bench.board.connect_ultrasonic(3, false);
  bench.run(250);
  EXPECT_EQ(bench.sample().ultrasonic_blind, 1 << 2);
  EXPECT_EQ(bench.sample().ultrasonic_cm[2], 0);
  bench.board.connect_ultrasonic(3, true);
  bench.run(300);
  EXPECT_EQ(bench.sample().ultrasonic_blind, 0);
  EXPECT_EQ(bench.sample().ultrasonic_cm[2], 42);
}

TEST(SimulatedHardware, PowerOnResetsTheBoardButNotItsSurroundings) {
  HardwareBench bench;
  bench.hardware.hal().apply(osmc(1, 4095, Direction::forward));
  bench.board.turn_encoder(2, 5);
  bench.board.hold_handle(false);
  bench.board.set_ultrasonic(4, 20);
  bench.run(100);
  bench.board.power_on();
  SimulatedHardware again(bench.board);
  again.power_up();
  for (int i = 0; i < 500; ++i) again.pass_millisecond();
  EXPECT_TRUE(bench.board.pins().is_safe());
  firmware::Inputs inputs;
  again.hal().sample(inputs);
  EXPECT_EQ(inputs.encoder_counts[0], 0);
  EXPECT_EQ(inputs.encoder_counts[1], 0);
  EXPECT_FALSE(inputs.handle_held());
  EXPECT_EQ(inputs.ultrasonic_cm[3], 20);
}

}  // namespace
}  // namespace r4::sim
