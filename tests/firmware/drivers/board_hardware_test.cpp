// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/board_hardware.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <functional>
#include <memory>

#include "pin_models.hpp"

namespace r4::firmware {
namespace {

using test::BoardModel;
using Lines = std::vector<std::string>;

// Between the hardware and the bus: something may happen in the middle of a transfer.
struct InterruptedBus final : I2cBus {
  explicit InterruptedBus(I2cBus& below) : bus(below) {}
  I2cResult write(std::uint8_t address, const std::uint8_t* bytes, std::size_t size) override {
    const bool cut = interrupt();
    return cut ? I2cResult::timeout : bus.write(address, bytes, size);
  }
  I2cResult write_read(std::uint8_t address, const std::uint8_t* out, std::size_t out_size,
                       std::uint8_t* in, std::size_t in_size) override {
    const bool cut = interrupt();
    return cut ? I2cResult::timeout : bus.write_read(address, out, out_size, in, in_size);
  }
  bool recover() override {
    ++recoveries;
    return bus.recover();
  }
  bool interrupt() {
    if (after < 0 || after-- != 0) return false;
    what();
    return cuts;
  }
  I2cBus& bus;
  int after = -1;  // that many transfers from now
  bool cuts = true;
  std::function<void()> what;
  int recoveries = 0;
};

struct Bench {
  explicit Bench(const BoardHardware::Config& config = {}) : hardware(line, board.pins(), config) {}
  std::uint32_t now() const { return static_cast<std::uint32_t>(board.bus.now_us()); }
  void run(int ms) {
    for (int i = 0; i < ms; ++i) {
      const std::uint64_t began = board.bus.now_us();
      hardware.poll(now());
      longest_poll_us = std::max(longest_poll_us, board.bus.now_us() - began);
      board.bus.advance(1000);
    }
  }
  void boot() {
    hardware.power_up(now());
    run(20);
    ASSERT_TRUE(hardware.ready());
    ASSERT_FALSE(hardware.fault().any());
    board.bus.clear_log();
    longest_poll_us = 0;
  }
  void apply(const Outputs& outputs, int polls = 8) {
    hardware.apply(outputs);
    run(polls);
  }
  BoardModel board;
  InterruptedBus line{board.bus};
  BoardHardware hardware;
  std::uint64_t longest_poll_us = 0;
};

// Everything moves.
Outputs full() {
  Outputs outputs;
  for (int i = 0; i < 4; ++i) {
    outputs.osmc[i] = {4095, Direction::forward};
    outputs.dhb12[i] = {2000, Direction::forward};
    outputs.bldc[i] = {3000, Direction::forward, false};
    outputs.stepper[i] = {1000000, 20000, true};
  }
  for (std::uint16_t& us : outputs.servo_us) us = 1500;
  outputs.relays = 0xFF;
  return outputs;
}

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

TEST(BoardHardware, OutputsAreOffBeforeAnythingElseAtPowerUp) {
  Bench bench;
  bench.hardware.power_up(bench.now());
  EXPECT_EQ(test::lines(bench.board.bus),
            (Lines{"70 <- FD 10", "61 <- 40 00 00 42 00 00 44 00 00 46 00 00", "20 <- 14 AA 00",
                   "20 <- 00 00 00", "40 <- FD 10", "41 <- FD 10", "42 <- FD 10"}));
  EXPECT_TRUE(test::is_safe(bench.board));
  for (int i = 0; i < 20; ++i) {
    bench.run(1);
    EXPECT_TRUE(test::is_safe(bench.board));
  }
  EXPECT_TRUE(bench.hardware.ready());
}

TEST(BoardHardware, AWarmStartTurnsOffWhatTheLastProgramLeftOn) {
  Bench bench;
  bench.boot();
  bench.apply(full());
  ASSERT_FALSE(test::is_safe(bench.board));
  BoardHardware next(bench.board.bus, bench.board.pins(), {});
  next.power_up(bench.now());
  EXPECT_TRUE(test::is_safe(bench.board));
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

TEST(BoardHardware, OneChannelIsOneShortTransfer) {
  Bench bench;
  bench.boot();
  Outputs outputs;
  bench.apply(outputs);
  bench.board.bus.clear_log();
  outputs.osmc[0] = {358, Direction::forward};
  bench.hardware.apply(outputs);
  EXPECT_EQ(test::lines(bench.board.bus), Lines{"40 <- 08 66 01 00 10 00 00"});
  bench.board.bus.clear_log();
  outputs.osmc[0].pwm = 400;
  bench.hardware.apply(outputs);
  EXPECT_EQ(test::lines(bench.board.bus), Lines{"40 <- 08 90"});
  EXPECT_EQ(test::outputs_of(bench.board), test::as_pins(outputs));
}

RC_GTEST_PROP(BoardHardware, PinsFollowAnySequenceOfOutputs, ()) {
  Bench bench;
  bench.boot();
  const auto sequence = *rc::gen::container<std::vector<Outputs>>(any_outputs());
  for (const Outputs& outputs : sequence) {
    bench.apply(outputs, 12);
    RC_ASSERT(test::outputs_of(bench.board) == test::as_pins(outputs));
    bench.board.bus.clear_log();
    bench.apply(outputs, 25);
    RC_ASSERT(test::writes(bench.board.bus).empty());
    RC_ASSERT(!bench.hardware.fault().any());
  }
  bench.hardware.make_safe();
  RC_ASSERT(test::is_safe(bench.board));
  bench.run(12);
  RC_ASSERT(test::is_safe(bench.board));
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

TEST(BoardHardware, NoCallCarriesMoreThanItsBudget) {
  Bench bench;
  bench.boot();
  Outputs outputs = full();
  for (int i = 0; i < 200; ++i) {
    for (std::uint16_t& us : outputs.servo_us) us = static_cast<std::uint16_t>(600 + 7 * i);
    outputs.osmc[i % 4].pwm = static_cast<std::uint16_t>(i);
    outputs.bldc[i % 4].speed = static_cast<std::uint16_t>(i);
    bench.board.bus.clear_log();
    bench.hardware.apply(outputs);
    EXPECT_LE(test::cost(bench.board.bus).bytes, BoardHardware::bus_bytes_per_poll);
    bench.board.bus.clear_log();
    bench.run(1);
    EXPECT_LE(test::cost(bench.board.bus).bytes, BoardHardware::bus_bytes_per_poll);
  }
  EXPECT_LE(bench.longest_poll_us, 1200U);
  EXPECT_FALSE(bench.hardware.fault().any());
}

TEST(BoardHardware, NoChipIsLeftBehindWhenOthersChangeAllTheTime) {
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

TEST(BoardHardware, SafeStateCostsWhatTheDocumentationSays) {
  Bench bench;
  bench.boot();
  bench.apply(full());
  bench.board.bus.clear_log();
  bench.hardware.make_safe();
  EXPECT_TRUE(test::is_safe(bench.board));
  EXPECT_EQ(test::lines(bench.board.bus).front(), "70 <- FD 10");
  const test::BusCost safe = test::cost(bench.board.bus);
  EXPECT_EQ(safe.bytes, 33U);
  EXPECT_EQ(safe.us, 777.5);
  for (int i = 0; i < 100; ++i) bench.hardware.step_tick();
  for (const auto& step : bench.board.step) EXPECT_FALSE(step.high);
}

TEST(BoardHardware, IsSafeFromAnyTransferOfAnyUseOn) {
  // make_safe() in an interrupt at every transfer of set-up, apply and verification: with the
  // transfer cut off, and with it going through afterwards, stale.
  for (const bool cuts : {true, false}) {
    for (int at = 0; at < 60; ++at) {
      Bench bench;
      bench.line.cuts = cuts;
      bench.line.what = [&] { bench.hardware.make_safe(); };
      bench.line.after = at;
      bench.hardware.power_up(bench.now());
      int polls = 0;
      while (bench.line.after >= 0 && polls++ < 200) {
        bench.run(1);
        if (bench.line.after < 0) break;
        Outputs outputs = full();
        outputs.osmc[0].pwm = static_cast<std::uint16_t>(polls);
        if (bench.hardware.ready()) bench.hardware.apply(outputs);
      }
      EXPECT_LT(bench.line.after, 0);
      EXPECT_TRUE(test::is_safe(bench.board)) << "transfer " << at << (cuts ? " cut" : " stale");
    }
  }
}

TEST(BoardHardware, AFaultHandlerThatNeverReturnsLeavesEverythingSafe) {
  struct Halt {};
  for (int at = 0; at < 12; ++at) {
    Bench bench;
    bench.boot();
    bench.apply(full());
    Outputs outputs = full();
    for (int i = 0; i < 4; ++i) outputs.dhb12[i].pwm = 77;
    for (std::uint16_t& us : outputs.servo_us) us = 999;
    bench.line.after = at;
    bench.line.what = [&] {
      bench.hardware.make_safe();
      throw Halt();
    };
    try {
      bench.hardware.apply(outputs);
      bench.run(200);
      FAIL() << "no transfer " << at;
    } catch (const Halt&) {
      EXPECT_TRUE(test::is_safe(bench.board)) << at;
    }
  }
}

TEST(BoardHardware, MayBeMadeSafeWhileItIsBeingMadeSafe) {
  for (int at = 0; at < 7; ++at) {
    Bench bench;
    bench.boot();
    bench.apply(full());
    bench.line.after = at;
    bench.line.what = [&] {
      bench.hardware.make_safe();
      EXPECT_EQ(bench.line.recoveries, 1) << at;  // the bus was in use
    };
    bench.hardware.make_safe();
    EXPECT_TRUE(test::is_safe(bench.board)) << at;
  }
}

struct ChipAt {
  Chip chip;
  std::uint8_t address;
};
constexpr ChipAt chips_at[] = {{Chip::osmc_pwm, 0x40},
                               {Chip::dhb12_pwm, 0x41},
                               {Chip::expander, 0x20},
                               {Chip::dac, 0x61},
                               {Chip::servo_pwm, 0x42}};

TEST(BoardHardware, ASilentChipIsAFaultWithItsNameAndEverythingElseGoesSafe) {
  for (const ChipAt& at : chips_at) {
    Bench bench;
    bench.boot();
    bench.apply(full());
    bench.board.bus.refuse(at.address, 0, 1000);
    bench.run(110);
    EXPECT_EQ(bench.hardware.fault().chip, at.chip);
    EXPECT_EQ(bench.hardware.fault().trouble, ChipTrouble::no_acknowledge);
    const Outputs pins = test::outputs_of(bench.board);
    EXPECT_EQ(pins.bldc[0].speed, at.chip == Chip::dac ? 3000 : 0);
    EXPECT_EQ(pins.bldc[0].brake, at.chip != Chip::expander);
    EXPECT_EQ(pins.relays, at.chip == Chip::expander ? 0xFF : 0);
    EXPECT_EQ(pins.osmc[0].pwm, 0);  // all-call reaches a chip that is silent at its own address
    EXPECT_FALSE(bench.hardware.clear_fault());
    bench.apply(full());
    EXPECT_EQ(test::outputs_of(bench.board).dhb12[1].pwm, 0);
  }
}

TEST(BoardHardware, ComesBackWithOutputsOffAndObeysAgainWhenTheFaultIsCleared) {
  for (const ChipAt& at : chips_at) {
    Bench bench;
    bench.boot();
    bench.apply(full());
    bench.board.bus.refuse(at.address, 0, 3);
    bench.run(400);
    EXPECT_TRUE(bench.hardware.ready()) << to_text(at.chip);
    EXPECT_EQ(bench.hardware.fault().chip, at.chip);
    EXPECT_TRUE(test::is_safe(bench.board));
    bench.apply(full());
    EXPECT_TRUE(test::is_safe(bench.board));
    EXPECT_TRUE(bench.hardware.clear_fault());
    EXPECT_TRUE(test::is_safe(bench.board));
    bench.apply(full());
    EXPECT_EQ(test::outputs_of(bench.board), test::as_pins(full()));
  }
}

TEST(BoardHardware, AChipThatWasResetIsNoticedWithinATurnOfVerification) {
  for (const ChipAt& at : chips_at) {
    Bench bench;
    bench.boot();
    bench.apply(full());
    sim::I2cChipModel* chips[] = {&bench.board.osmc, &bench.board.dhb12, &bench.board.expander,
                                  &bench.board.dac, &bench.board.servo};
    chips[static_cast<int>(at.chip)]->power_on();
    bench.run(chip_count * 20 + 2);
    EXPECT_EQ(bench.hardware.fault().chip, at.chip);
    EXPECT_EQ(bench.hardware.fault().trouble, ChipTrouble::was_reset) << to_text(at.chip);
    EXPECT_TRUE(test::is_safe(bench.board));
    bench.run(200);
    EXPECT_TRUE(bench.hardware.clear_fault());
  }
}

TEST(BoardHardware, AChipThatIsResetAtAnyByteNeverLeavesAnythingRunningUnnoticed) {
  for (std::size_t after = 1; after < 120; after += 3) {
    for (const ChipAt& at : chips_at) {
      Bench bench;
      bench.boot();
      sim::I2cChipModel* chips[] = {&bench.board.osmc, &bench.board.dhb12, &bench.board.expander,
                                    &bench.board.dac, &bench.board.servo};
      bench.board.bus.reset_after(*chips[static_cast<int>(at.chip)], after);
      bench.apply(full(), 240);
      if (bench.hardware.fault().any()) {
        EXPECT_TRUE(test::is_safe(bench.board));
      } else {
        EXPECT_EQ(test::outputs_of(bench.board), test::as_pins(full())) << after;
      }
    }
  }
}

TEST(BoardHardware, AHeldBusIsFreedAndEverythingIsSafeAtOnce) {
  for (std::size_t after = 1; after < 60; ++after) {
    Bench bench;
    bench.boot();
    bench.board.bus.hold_after(after);
    bench.hardware.apply(full());
    for (int ms = 0; ms < 110 && !bench.hardware.fault().any(); ++ms) bench.run(1);
    EXPECT_EQ(bench.hardware.fault().trouble, ChipTrouble::bus_stuck);
    EXPECT_TRUE(test::is_safe(bench.board)) << after;
    EXPECT_LE(bench.longest_poll_us, 5000U);
    bench.run(300);
    EXPECT_TRUE(bench.hardware.clear_fault());
    bench.apply(full());
    EXPECT_EQ(test::outputs_of(bench.board), test::as_pins(full()));
  }
}

TEST(BoardHardware, ABusThatStaysHeldCostsTheLoopLittle) {
  Bench bench;
  bench.boot();
  bench.apply(full());
  bench.board.bus.hold(1000);
  bench.run(300);
  EXPECT_EQ(bench.hardware.fault().trouble, ChipTrouble::bus_stuck);
  EXPECT_LE(bench.longest_poll_us, 3 * (i2c_timeout_us + 200));
  bench.longest_poll_us = 0;
  bench.run(1000);
  EXPECT_LE(bench.longest_poll_us, 100U);
  const std::uint64_t began = bench.board.bus.now_us();
  bench.hardware.make_safe();
  EXPECT_LE(bench.board.bus.now_us() - began, i2c_timeout_us + 100U);
}

TEST(BoardHardware, AChipThatIsNotFittedIsLeftAlone) {
  BoardHardware::Config config;
  config.chips_fitted = 1U << static_cast<int>(Chip::osmc_pwm);
  Bench bench(config);
  bench.boot();
  bench.apply(full());
  bench.run(200);
  for (const std::string& line : test::lines(bench.board.bus)) {
    EXPECT_EQ(line.substr(0, 2), "40") << line;
  }
  EXPECT_FALSE(bench.hardware.fault().any());
}

TEST(BoardHardware, TheHandleCountsAsHeldAfterAWhileAndAsReleasedAtOnce) {
  Bench bench;
  bench.boot();
  Inputs inputs;
  bench.board.handle.high = true;
  bench.run(15);
  bench.hardware.sample(inputs);
  EXPECT_FALSE(inputs.handle_held);
  bench.run(10);
  bench.hardware.sample(inputs);
  EXPECT_TRUE(inputs.handle_held);
  bench.board.handle.high = false;
  bench.hardware.sample(inputs);
  EXPECT_FALSE(inputs.handle_held);
  bench.run(1);
  bench.board.handle.high = true;
  bench.run(15);
  bench.hardware.sample(inputs);
  EXPECT_FALSE(inputs.handle_held);
}

TEST(BoardHardware, InputsComeFromPinsAndInterrupts) {
  BoardHardware::Config config;
  config.ultrasonic_fitted = 0b0100;
  Bench bench(config);
  bench.boot();
  bench.board.analog[0].counts = 31733;
  bench.hardware.encoder(2).sample(false, false);
  bench.hardware.encoder(2).sample(true, false);
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
  EXPECT_EQ(inputs.ultrasonic_cm[2], 120);
  EXPECT_EQ(inputs.stepper_steps[3], 5);
  EXPECT_EQ(bench.board.step[3].rises, 5);
  bench.hardware.zero(2);
  bench.hardware.zero(4);
  bench.hardware.sample(inputs);
  EXPECT_EQ(inputs.encoder_counts[1], 0);
  EXPECT_EQ(inputs.stepper_steps[3], 0);
}

TEST(BoardHardware, SteppersStandInTheSafeState) {
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

TEST(BoardHardware, ChangesCostWhatTheDocumentationSays) {
  Bench bench;
  bench.boot();
  Outputs outputs;
  bench.apply(outputs);
  bench.board.bus.clear_log();
  int calls = 0;
  for (std::size_t before = 1; before != bench.board.bus.log().size(); ++calls) {
    before = bench.board.bus.log().size();
    bench.hardware.apply(full());
  }
  EXPECT_EQ(calls - 1, 4);
  const test::BusCost everything = test::cost(bench.board.bus);
  EXPECT_EQ(everything.bytes, 146U);
  EXPECT_EQ(everything.us, 3325);
  const auto cost_of = [&](Drive drive) {
    outputs.osmc[0] = drive;
    bench.board.bus.clear_log();
    bench.hardware.apply(outputs);
    EXPECT_EQ(bench.board.bus.log().size(), 1U);
    return test::cost(bench.board.bus);
  };
  outputs = full();
  EXPECT_EQ(cost_of({0x123, Direction::forward}).us, 117.5);
  EXPECT_EQ(cost_of({0x124, Direction::forward}).us, 72.5);
  EXPECT_EQ(cost_of({0x200, Direction::reverse}).us, 185);
}

TEST(BoardHardware, WhatIsAppliedBeforeEveryChipIsReadyWaits) {
  Bench bench;
  for (int i = 0; i < sim::Mcp4728Model::channels; ++i) {
    bench.board.dac.set_eeprom(i, {true, 0, false, 2000});
  }
  bench.board.power_on();
  bench.hardware.power_up(bench.now());
  bench.hardware.apply(full());
  while (!bench.hardware.ready()) {
    EXPECT_TRUE(test::is_safe(bench.board));
    bench.hardware.step_tick();
    ASSERT_LT(bench.now(), 100000U);
    bench.run(1);
  }
  EXPECT_EQ(bench.board.dac.eeprom_writes(), 1);
  bench.run(10);
  EXPECT_EQ(test::outputs_of(bench.board), test::as_pins(full()));
  EXPECT_EQ(bench.board.step[0].rises, 0);
}

TEST(BoardHardware, TheSafeStateForgetsWhatWasWaiting) {
  Bench bench;
  bench.hardware.power_up(bench.now());
  bench.hardware.apply(full());
  bench.hardware.make_safe();
  bench.run(30);
  EXPECT_TRUE(bench.hardware.ready());
  EXPECT_TRUE(test::is_safe(bench.board));
}

}  // namespace
}  // namespace r4::firmware
