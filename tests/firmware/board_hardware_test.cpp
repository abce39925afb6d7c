// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/board_hardware.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include "board_bench.hpp"

namespace r4::firmware {
namespace {

using Bench = test::BoardBench;
using test::full;
using Lines = std::vector<std::string>;

rc::Gen<Outputs> any_outputs() {
  return rc::gen::exec([] {
    Outputs outputs;
    const auto pwm = [] {
      return static_cast<std::uint16_t>(
          *rc::gen::oneOf(rc::gen::inRange(0, 4096), rc::gen::element(0, 1, 255, 256, 4094, 4095)));
    };
    const auto direction = [] {
      return *rc::gen::arbitrary<bool>() ? Direction::forward : Direction::reverse;
    };
    for (int i = 0; i < 4; ++i) {
      outputs.osmc[i] = {pwm(), direction()};
      outputs.dhb12[i] = {pwm(), direction()};
      outputs.bldc[i] = {pwm(), direction(), *rc::gen::arbitrary<bool>()};
    }
    for (std::uint16_t& us : outputs.servo_us) {
      us = *rc::gen::oneOf(rc::gen::just<std::uint16_t>(0),
                           rc::gen::inRange<std::uint16_t>(500, 2501));
    }
    outputs.relays = *rc::gen::arbitrary<std::uint8_t>();
    return outputs;
  });
}

TEST(BoardHardware, PowerUpTurnsTheOutputsOffFirst) {
  Bench bench;
  bench.hardware.power_up(bench.now());
  EXPECT_EQ(
      test::lines(bench.log),
      (Lines{"00 <- 06", "70 <- FD 10", "61 <- 40 00 00 42 00 00 44 00 00 46 00 00",
             "20 <- 14 AA 00", "20 <- 00 00 00", "40 <- FD 10", "41 <- FD 10", "42 <- FD 10"}));
  EXPECT_TRUE(bench.board.pins().is_safe());
  for (int i = 0; i < 20; ++i) {
    bench.run(1);
    EXPECT_TRUE(bench.board.pins().is_safe());
  }
  EXPECT_TRUE(bench.hardware.ready());
}

TEST(BoardHardware, AWarmStartTurnsOffOutputsThatWereLeftOn) {
  Bench bench;
  bench.boot();
  bench.apply(full());
  ASSERT_FALSE(bench.board.pins().is_safe());
  BoardHardware next(bench.board.bus, bench.board.microcontroller_pins(), {});
  next.power_up(bench.now());
  EXPECT_TRUE(bench.board.pins().is_safe());
}

TEST(BoardHardware, EveryChannelReachesItsPin) {
  Bench bench;
  bench.boot();
  bench.apply(full());
  EXPECT_EQ(test::outputs_of(bench.board), test::as_pins(full()));
  EXPECT_NEAR(bench.board.servo.pulse_us(0), 1500, 2.5);
  EXPECT_NEAR(bench.board.servo.frequency_hz(), 50, 0.1);
  EXPECT_NEAR(bench.board.osmc.frequency_hz(), 1000, 20);
}

TEST(BoardHardware, ChangingOneChannelTakesOneShortTransfer) {
  Bench bench;
  bench.boot();
  Outputs outputs;
  bench.apply(outputs);
  bench.log.clear();
  outputs.osmc[0] = {358, Direction::forward};
  bench.hardware.apply(outputs);
  EXPECT_EQ(test::lines(bench.log), Lines{"40 <- 08 66 01 00 10 00 00"});
  bench.log.clear();
  outputs.osmc[0].pwm = 400;
  bench.hardware.apply(outputs);
  EXPECT_EQ(test::lines(bench.log), Lines{"40 <- 08 90"});
  EXPECT_EQ(test::outputs_of(bench.board), test::as_pins(outputs));
}

RC_GTEST_PROP(BoardHardware, PinsFollowAnySequenceOfOutputs, ()) {
  Bench bench;
  bench.boot();
  const auto sequence = *rc::gen::container<std::vector<Outputs>>(any_outputs());
  for (const Outputs& outputs : sequence) {
    bench.apply(outputs, 12);
    RC_ASSERT(test::outputs_of(bench.board) == test::as_pins(outputs));
    bench.log.clear();
    bench.apply(outputs, 25);
    RC_ASSERT(test::writes(bench.log).empty());
    RC_ASSERT(!bench.hardware.fault().any());
  }
  bench.hardware.make_safe();
  RC_ASSERT(bench.board.pins().is_safe());
  bench.run(12);
  RC_ASSERT(bench.board.pins().is_safe());
}

RC_GTEST_PROP(BoardHardware, PinsSettleOnTheNewestOutputsHoweverFastTheyChange, ()) {
  Bench bench;
  bench.boot();
  const auto sequence = *rc::gen::container<std::vector<Outputs>>(any_outputs());
  for (const Outputs& outputs : sequence) bench.apply(outputs, *rc::gen::inRange(0, 3));
  bench.run(12);
  if (sequence.empty()) return;
  RC_ASSERT(test::outputs_of(bench.board) == test::as_pins(sequence.back()));
}

TEST(BoardHardware, AChannelNeverShowsADutyWithTheOldDirection) {
  Bench bench;
  bench.boot();
  Outputs outputs = full();
  bench.apply(outputs);
  for (int i = 0; i < 4; ++i) {
    outputs.osmc[i] = {100, Direction::reverse};
    outputs.dhb12[i] = {100, Direction::reverse};
  }
  for (std::uint16_t& us : outputs.servo_us) us = 900;
  bench.hardware.apply(outputs);
  for (int i = 0; i < 8; ++i) {
    const Outputs pins = test::outputs_of(bench.board);
    for (int n = 0; n < 4; ++n) {
      EXPECT_TRUE(pins.osmc[n] == full().osmc[n] || pins.osmc[n] == outputs.osmc[n]);
      EXPECT_TRUE(pins.dhb12[n] == full().dhb12[n] || pins.dhb12[n] == outputs.dhb12[n]);
    }
    bench.run(1);
  }
  EXPECT_EQ(test::outputs_of(bench.board), test::as_pins(outputs));
}

TEST(BoardHardware, NoPollWritesMoreThanItsByteBudget) {
  Bench bench;
  bench.boot();
  Outputs outputs = full();
  for (int i = 0; i < 200; ++i) {
    for (std::uint16_t& us : outputs.servo_us) us = static_cast<std::uint16_t>(600 + 7 * i);
    outputs.osmc[i % 4].pwm = static_cast<std::uint16_t>(i);
    outputs.bldc[i % 4].speed = static_cast<std::uint16_t>(i);
    bench.log.clear();
    bench.hardware.apply(outputs);
    EXPECT_LE(test::cost(bench.log).bytes, BoardHardware::bus_bytes_per_poll);
    bench.log.clear();
    bench.run(1);
    EXPECT_LE(test::cost(bench.log).bytes, BoardHardware::bus_bytes_per_poll);
  }
  EXPECT_LE(bench.longest_poll_us, 1200U);
  EXPECT_FALSE(bench.hardware.fault().any());
}

TEST(BoardHardware, WritesEveryChipWhileOtherChipsKeepChanging) {
  Bench bench;
  bench.boot();
  Outputs outputs = full();
  for (int i = 0; i < 12; ++i) {
    const Drive drive = i % 2 == 0 ? Drive{0x123, Direction::reverse} : full().osmc[0];
    for (int n = 0; n < 4; ++n) outputs.osmc[n] = outputs.dhb12[n] = drive;
    bench.hardware.apply(outputs);
  }
  EXPECT_EQ(test::outputs_of(bench.board).relays, 0xFF);
  EXPECT_EQ(test::outputs_of(bench.board).servo_us[15], test::as_pins(outputs).servo_us[15]);
}

TEST(BoardHardware, TheSafeStateTakesTheDocumentedBusTime) {
  Bench bench;
  bench.boot();
  bench.apply(full());
  bench.log.clear();
  bench.hardware.make_safe();
  EXPECT_TRUE(bench.board.pins().is_safe());
  EXPECT_EQ(test::lines(bench.log).front(), "70 <- FD 10");
  const test::BusCost safe = test::cost(bench.log);
  EXPECT_EQ(safe.bytes, 33U);
  EXPECT_EQ(safe.us, 777.5);
  for (int i = 0; i < 100; ++i) bench.hardware.step_tick();
  for (const auto& step : bench.board.step) EXPECT_FALSE(step.high);
}

TEST(BoardHardware, DoesNotAccessAChipThatIsNotFitted) {
  BoardHardware::Config config;
  for (int i = signals::osmc_chip + 1; i <= signals::dac_chip; ++i) config.wiring.places[i] = {};
  Bench bench(config);
  bench.boot();
  bench.apply(full());
  bench.run(200);
  for (const std::string& line : test::lines(bench.log)) {
    EXPECT_EQ(line.substr(0, 2), "40") << line;
  }
  EXPECT_FALSE(bench.hardware.fault().any());
}

TEST(BoardHardware, AWiringThatNobodyHasConfirmedIsAFaultUntilItIsCleared) {
  BoardHardware::Config config;
  config.wiring_trouble = ChipTrouble::not_confirmed;
  Bench bench(config);
  bench.hardware.power_up(bench.now());
  bench.run(20);
  EXPECT_EQ(bench.hardware.fault(), (ChipFault{0, ChipTrouble::not_confirmed}));
  bench.apply(full());
  EXPECT_TRUE(bench.board.pins().is_safe());
  EXPECT_TRUE(bench.hardware.clear_fault());
  bench.apply(full());
  EXPECT_EQ(test::outputs_of(bench.board), test::as_pins(full()));
  bench.board.bus.refuse(0x40, 0, 1000);
  bench.run(110);
  EXPECT_EQ(bench.hardware.fault().address, 0x40);
}

TEST(BoardHardware, AChipsFaultIsReportedBeforeThatOfTheWiring) {
  BoardHardware::Config config;
  config.wiring_trouble = ChipTrouble::not_confirmed;
  Bench bench(config);
  bench.board.bus.refuse(0x61, 0, 1000);
  bench.hardware.power_up(bench.now());
  bench.run(20);
  EXPECT_EQ(bench.hardware.fault(), (ChipFault{0x61, ChipTrouble::no_acknowledge}));
}

TEST(BoardHardware, ADamagedWiringConnectsNothingAndCannotBeCleared) {
  BoardHardware::Config config;
  config.wiring = Wiring();
  config.wiring_trouble = ChipTrouble::damaged;
  Bench bench(config);
  bench.hardware.power_up(bench.now());
  bench.run(200);
  bench.apply(full());
  EXPECT_TRUE(bench.log.transfers().empty());
  EXPECT_FALSE(bench.hardware.clear_fault());
  EXPECT_EQ(bench.hardware.fault(), (ChipFault{0, ChipTrouble::damaged}));
}

TEST(BoardHardware, DebouncesAHeldHandleButNoticesAReleaseAtOnce) {
  Bench bench;
  bench.boot();
  Inputs inputs;
  bench.board.handle.high = true;
  bench.run(15);
  bench.hardware.sample(inputs);
  EXPECT_FALSE(inputs.handle_held());
  bench.run(10);
  bench.hardware.sample(inputs);
  EXPECT_TRUE(inputs.handle_held());
  bench.board.handle.high = false;
  bench.hardware.sample(inputs);
  EXPECT_FALSE(inputs.handle_held());
  bench.run(1);
  bench.board.handle.high = true;
  bench.run(15);
  bench.hardware.sample(inputs);
  EXPECT_FALSE(inputs.handle_held());
}

TEST(BoardHardware, InputsComeFromPinsAndInterrupts) {
  BoardHardware::Config config;
  for (const int other : {1, 2, 4}) {
    config.wiring.at(SignalKind::trigger, other) = {};
    config.wiring.at(SignalKind::echo, other) = {};
  }
  Bench bench(config);
  bench.boot();
  bench.board.analog[0].counts = 31733;
  bench.hardware.encoder(2).sample(false, false);
  bench.hardware.encoder(2).sample(true, false);
  bench.hardware.encoder(2).index(true);
  while (!bench.board.trigger[2].high) bench.run(1);
  bench.run(1);
  const std::uint32_t at = bench.now();
  bench.hardware.ultrasonic().echo(2, true, at);
  bench.hardware.ultrasonic().echo(2, false, at + 58 * 120);
  bench.run(1);
  Outputs outputs;
  outputs.stepper[3] = {5, 20000, true};
  bench.hardware.apply(outputs);
  for (int i = 0; i < 100; ++i) bench.hardware.step_tick();
  Inputs inputs;
  bench.hardware.sample(inputs);
  EXPECT_EQ(inputs.analog_cv[0], 2421);
  EXPECT_EQ(inputs.encoder_counts[1], 1);
  EXPECT_EQ(inputs.encoder_index_counts[1], 1);
  EXPECT_EQ(inputs.ultrasonic_cm[2], 120);
  EXPECT_EQ(inputs.stepper_steps[3], 5);
  EXPECT_EQ(bench.board.step[3].rises, 5);
  bench.hardware.zero(2);
  bench.hardware.zero(4);
  bench.hardware.sample(inputs);
  EXPECT_EQ(inputs.encoder_counts[1], 0);
  EXPECT_EQ(inputs.stepper_steps[3], 0);
}

TEST(BoardHardware, SteppersStopInTheSafeState) {
  Bench bench;
  bench.boot();
  bench.hardware.apply(full());
  for (int i = 0; i < 1000; ++i) bench.hardware.step_tick();
  Inputs before;
  bench.hardware.sample(before);
  EXPECT_GT(before.stepper_steps[0], 400);
  bench.hardware.make_safe();
  for (int i = 0; i < 1000; ++i) bench.hardware.step_tick();
  Inputs after;
  bench.hardware.sample(after);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(after.stepper_steps[i], before.stepper_steps[i]);
}

TEST(BoardHardware, ChangesTakeTheDocumentedBusTime) {
  Bench bench;
  bench.boot();
  Outputs outputs;
  bench.apply(outputs);
  bench.log.clear();
  int calls = 0;
  for (std::size_t before = 1; before != bench.log.transfers().size(); ++calls) {
    before = bench.log.transfers().size();
    bench.hardware.apply(full());
  }
  EXPECT_EQ(calls - 1, 4);
  const test::BusCost everything = test::cost(bench.log);
  EXPECT_EQ(everything.bytes, 146U);
  EXPECT_EQ(everything.us, 3320);
  const auto cost_of = [&](Drive drive) {
    outputs.osmc[0] = drive;
    bench.log.clear();
    bench.hardware.apply(outputs);
    EXPECT_EQ(bench.log.transfers().size(), 1U);
    return test::cost(bench.log);
  };
  outputs = full();
  EXPECT_EQ(cost_of({0x123, Direction::forward}).us, 117.5);
  EXPECT_EQ(cost_of({0x124, Direction::forward}).us, 72.5);
  EXPECT_EQ(cost_of({0x200, Direction::reverse}).us, 185);
}

TEST(BoardHardware, OutputsAppliedBeforeTheChipsAreReadyWait) {
  Bench bench;
  for (int i = 0; i < sim::Mcp4728Model::channels; ++i) {
    bench.board.dac.set_eeprom(i, {true, 0, false, 2000});
  }
  bench.board.power_on();
  bench.hardware.power_up(bench.now());
  bench.hardware.apply(full());
  while (!bench.hardware.ready()) {
    EXPECT_TRUE(bench.board.pins().is_safe());
    bench.hardware.step_tick();
    ASSERT_LT(bench.now(), 100000U);
    bench.run(1);
  }
  EXPECT_EQ(bench.board.dac.eeprom_writes(), 1);
  bench.run(10);
  EXPECT_EQ(test::outputs_of(bench.board), test::as_pins(full()));
  EXPECT_EQ(bench.board.step[0].rises, 0);
}

TEST(BoardHardware, TheSafeStateDropsWaitingOutputs) {
  Bench bench;
  bench.hardware.power_up(bench.now());
  bench.hardware.apply(full());
  bench.hardware.make_safe();
  bench.run(30);
  EXPECT_TRUE(bench.hardware.ready());
  EXPECT_TRUE(bench.board.pins().is_safe());
}

TEST(BoardHardware, SetsDacVoltagesAndZeroesThemInTheSafeState) {
  Bench bench;
  bench.boot();
  Outputs outputs;
  outputs.dac_mv[0] = 1650;
  outputs.dac_mv[1] = 3300;
  bench.apply(outputs);
  EXPECT_EQ(bench.board.analog_output[0].millivolts, 1650);
  EXPECT_EQ(bench.board.analog_output[1].millivolts, 3300);
  bench.hardware.make_safe();
  EXPECT_EQ(bench.board.analog_output[0].millivolts, 0);
  EXPECT_EQ(bench.board.analog_output[1].millivolts, 0);
}

TEST(BoardHardware, ReadsTheSpareInputs) {
  Bench bench;
  bench.boot();
  firmware::Inputs inputs;
  bench.board.gpio[2].high = bench.board.gpio[7].high = true;
  bench.hardware.sample(inputs);
  EXPECT_EQ(inputs.gpio, 0x84);
}

}  // namespace
}  // namespace r4::firmware
