// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/drivers/pca9685.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <array>

#include "bus_log.hpp"
#include "firmware/ports/sim/chips/pca9685_model.hpp"
#include "r4link/wiring/wiring.hpp"

namespace r4::firmware {
namespace {

using sim::I2cBusModel;
using sim::Pca9685Model;
using Lines = std::vector<std::string>;

struct Pca9685Bench {
  explicit Pca9685Bench(std::uint32_t hz = 1000) : pwm(bus, 0x40, hz) { bus.attach(chip); }
  void set_up() {
    pwm.begin();
    test::run(pwm, bus, 5);
    ASSERT_TRUE(pwm.ready());
    log.clear();
  }
  Lines write(std::size_t bytes = 100) {
    log.clear();
    BusBudget budget(bytes);
    pwm.write_changes(budget);
    return test::lines(log);
  }
  void verify() {
    BusBudget budget(48);
    pwm.verify(budget);
  }
  I2cBusModel bus;
  test::BusLog log{bus};
  Pca9685Model chip{0x40};
  Pca9685 pwm;
};

TEST(Pca9685, SetsTheFrequencyInSleepAndRestartsHalfAMillisecondLater) {
  Pca9685Bench bench(50);
  bench.pwm.begin();
  test::run(bench.pwm, bench.bus, 5);
  EXPECT_EQ(test::lines(bench.log),
            (Lines{"40 <- FD 10", "40 <- 00 31 04", "40 <- FE 79", "40 <- 00 21", "40 <- 00 A1",
                   "40 <- FA 00 00 00 10", "40 <- 00 -> 21 04", "40 <- FE -> 79"}));
  const auto& log = bench.log.transfers();
  EXPECT_GE(log[4].start_ns - (log[3].start_ns + log[3].duration_ns), 500'000U);
  EXPECT_TRUE(bench.pwm.ready());
  EXPECT_NEAR(bench.chip.frequency_hz(), 50, 0.1);
}

TEST(Pca9685, ComputesThePrescaleOfTheDataSheet) {
  EXPECT_EQ(Pca9685::prescale_for(50), 121);
  EXPECT_EQ(Pca9685::prescale_for(1000), 5);
  EXPECT_EQ(Pca9685::prescale_for(200), 30);  // the reset value
  EXPECT_EQ(Pca9685::prescale_for(1526), 3);
  EXPECT_EQ(Pca9685::prescale_for(24), 253);
}

TEST(Pca9685, SetUpTurnsOffADrivingChipFirst) {
  Pca9685Bench bench;
  bench.set_up();
  for (int i = 0; i < Pca9685::channels; ++i) bench.pwm.set_duty(i, 4095);
  bench.write();
  EXPECT_TRUE(bench.chip.high(15));
  bench.pwm.begin();
  BusBudget one(3);
  bench.pwm.poll(0, one);
  for (int i = 0; i < Pca9685::channels; ++i) EXPECT_EQ(bench.chip.duty(i), 0);
  test::run(bench.pwm, bench.bus, 5);
  EXPECT_TRUE(bench.pwm.ready());
  for (int i = 0; i < Pca9685::channels; ++i) EXPECT_EQ(bench.chip.duty(i), 0);
}

TEST(Pca9685, FullAndZeroDutyUseTheFullBits) {
  Pca9685Bench bench;
  bench.set_up();
  bench.pwm.set_duty(3, 0x5A3);
  EXPECT_EQ(bench.write(), (Lines{"40 <- 14 A3 05"}));
  EXPECT_EQ(bench.chip.duty(3), 0x5A3);
  bench.pwm.set_duty(3, 4095);
  EXPECT_EQ(bench.write(), (Lines{"40 <- 13 10 A3 00"}));
  EXPECT_EQ(bench.chip.duty(3), 4096);
  bench.pwm.set_duty(3, 0);
  EXPECT_EQ(bench.write(), (Lines{"40 <- 15 10"}));
  EXPECT_EQ(bench.chip.duty(3), 0);
  bench.pwm.set_duty(3, 1);
  EXPECT_EQ(bench.write(), (Lines{"40 <- 13 00 01 00"}));
  EXPECT_EQ(bench.chip.duty(3), 1);
}

TEST(Pca9685, APulseIsRoundedToTheNearestCount) {
  Pca9685Bench bench(50);
  bench.set_up();
  for (int us = 3; us <= 2500; ++us) {
    bench.pwm.set_pulse_us(0, static_cast<std::uint16_t>(us));
    bench.write();
    ASSERT_NEAR(bench.chip.pulse_us(0), us, 2.45) << us;
  }
  bench.pwm.set_pulse_us(0, 0);
  bench.write();
  EXPECT_EQ(bench.chip.duty(0), 0);
}

TEST(Pca9685, WritesNothingWhenNothingChanged) {
  Pca9685Bench bench;
  bench.set_up();
  bench.pwm.set_duty(0, 100);
  bench.write();
  bench.pwm.set_duty(0, 200);
  bench.pwm.set_duty(0, 100);
  EXPECT_EQ(bench.write(), Lines{});
}

TEST(Pca9685, WritesNeighbouringChannelsInOneBurst) {
  Pca9685Bench bench;
  bench.set_up();
  bench.pwm.set_duty(0, 0x111);
  bench.pwm.set_duty(1, 0x222);
  bench.pwm.set_duty(9, 0x333);
  EXPECT_EQ(bench.write(), (Lines{"40 <- 08 11 01 00 00 22 02", "40 <- 2C 33 03"}));
}

TEST(Pca9685, TheChannelsOfAPairChangeInOneTransferHoweverFarApart) {
  Pca9685Bench bench;
  bench.set_up();
  bench.pwm.pair(2, 12);
  bench.pwm.pair(3, 13);
  for (const int first : {2, 3}) {
    bench.pwm.set_duty(first, 0x123);
    bench.pwm.set_level(first + 10, true);
  }
  constexpr std::size_t one_pair = 2 + 4 * partner_lines;
  EXPECT_EQ(bench.write(one_pair).size(), 1U);
  EXPECT_EQ(bench.chip.duty(2), 0x123);
  EXPECT_TRUE(bench.chip.high(12));
  EXPECT_EQ(bench.chip.duty(3), 0) << "a channel in between waits for its partner";
  EXPECT_EQ(bench.write(one_pair).size(), 1U);
  EXPECT_EQ(bench.chip.duty(3), 0x123);
  EXPECT_TRUE(bench.chip.high(13));
}

TEST(Pca9685, DutyAndDirectionOfAPairChangeInOneTransfer) {
  Pca9685Bench bench;
  bench.set_up();
  bench.pwm.pair(2, 3);
  bench.pwm.set_duty(2, 0x800);
  bench.pwm.set_level(3, true);
  bench.write();
  bench.pwm.set_duty(2, 0x123);
  bench.pwm.set_level(3, false);
  EXPECT_EQ(bench.write().size(), 1U);
  EXPECT_EQ(bench.chip.duty(2), 0x123);
  EXPECT_FALSE(bench.chip.high(3));
}

TEST(Pca9685, ASmallBudgetSplitsOnlyBetweenPairs) {
  Pca9685Bench bench;
  bench.set_up();
  for (int i = 0; i < 8; i += 2) bench.pwm.pair(i, i + 1);
  for (int i = 0; i < 8; i += 2) {
    bench.pwm.set_duty(i, 0x0FF);
    bench.pwm.set_level(i + 1, true);
  }
  const auto of = [&](int drive) {
    return std::pair(bench.chip.duty(2 * drive), bench.chip.high(2 * drive + 1));
  };
  int writes = 0;
  for (; writes < 4 && of(3) != std::pair(0x0FF, true); ++writes) {
    EXPECT_EQ(bench.write(20).size(), 1U);
    EXPECT_LE(test::cost(bench.log).bytes, 20U);
    for (int drive = 0; drive < 4; ++drive) {
      EXPECT_TRUE(of(drive) == std::pair(0, false) || of(drive) == std::pair(0x0FF, true));
    }
  }
  EXPECT_EQ(writes, 2);
  EXPECT_EQ(bench.write(20), Lines{});
}

TEST(Pca9685, AllOffReachesEveryChipInThreeBytes) {
  I2cBusModel bus;
  test::BusLog log{bus};
  Pca9685Model chips[] = {Pca9685Model(0x40), Pca9685Model(0x41), Pca9685Model(0x42)};
  for (Pca9685Model& chip : chips) bus.attach(chip);
  Pca9685 drivers[] = {{bus, 0x40, 1000}, {bus, 0x41, 1000}, {bus, 0x42, 50}};
  for (Pca9685& driver : drivers) {
    driver.begin();
    test::run(driver, bus, 5);
    for (int i = 0; i < Pca9685::channels; ++i) driver.set_duty(i, 4095);
    BusBudget budget(100);
    driver.write_changes(budget);
  }
  log.clear();
  EXPECT_EQ(Pca9685::all_off(bus), I2cResult::ok);
  EXPECT_EQ(test::lines(log), Lines{"70 <- FD 10"});
  EXPECT_EQ(test::cost(log).us, 72.5);
  for (const Pca9685Model& chip : chips) {
    for (int i = 0; i < Pca9685::channels; ++i) EXPECT_EQ(chip.duty(i), 0);
  }
}

TEST(Pca9685, TheSafeStateTakesOneTransferAndTheNextDutyWorks) {
  Pca9685Bench bench;
  bench.set_up();
  bench.pwm.set_duty(0, 4095);
  bench.pwm.set_duty(5, 77);
  bench.write();
  bench.log.clear();
  EXPECT_EQ(bench.pwm.make_safe(), I2cResult::ok);
  EXPECT_EQ(test::lines(bench.log), Lines{"40 <- FD 10"});
  EXPECT_EQ(bench.chip.duty(0), 0);
  EXPECT_EQ(bench.chip.duty(5), 0);
  EXPECT_EQ(bench.write(), Lines{});
  bench.pwm.set_duty(0, 9);
  bench.pwm.set_duty(5, 77);
  bench.write();
  EXPECT_EQ(bench.chip.duty(0), 9);
  EXPECT_EQ(bench.chip.duty(5), 77);
}

TEST(Pca9685, ReportsAChipThatDoesNotAnswer) {
  Pca9685Bench bench;
  bench.set_up();
  bench.bus.refuse(0x40, 0, 1);
  bench.pwm.set_duty(0, 1);
  EXPECT_EQ(bench.write(), Lines{"40 <-  NACK"});
  EXPECT_EQ(bench.pwm.trouble(), ChipTrouble::no_acknowledge);
  EXPECT_FALSE(bench.pwm.ready());
  EXPECT_EQ(bench.write(), Lines{});  // no transfer until begin()
  bench.set_up();
  EXPECT_EQ(bench.pwm.trouble(), ChipTrouble::none);
}

TEST(Pca9685, ReportsARefusedByteAtEachStepOfTheSetUp) {
  for (std::size_t after = 0; after < 5; ++after) {
    for (int step = 0; step < 6; ++step) {
      Pca9685Bench bench;
      bench.pwm.begin();
      for (int i = 0; i < 20 && static_cast<int>(bench.log.transfers().size()) < step; ++i) {
        BusBudget one(7);
        bench.pwm.poll(static_cast<std::uint32_t>(bench.bus.now_us()), one);
        bench.bus.advance(1000);
      }
      bench.bus.refuse(0x40, after);
      test::run(bench.pwm, bench.bus, 6);
      const bool ready = bench.pwm.ready();
      EXPECT_NE(ready, bench.pwm.trouble() == ChipTrouble::no_acknowledge);
      for (int i = 0; i < Pca9685::channels; ++i) EXPECT_EQ(bench.chip.duty(i), 0);
    }
  }
}

TEST(Pca9685, NoticesAChipReset) {
  Pca9685Bench bench;
  bench.set_up();
  bench.verify();
  EXPECT_EQ(bench.pwm.trouble(), ChipTrouble::none);
  bench.chip.power_on();
  bench.verify();
  EXPECT_EQ(bench.pwm.trouble(), ChipTrouble::was_reset);
}

TEST(Pca9685, ReportsAChipResetDuringATransfer) {
  Pca9685Bench bench;
  bench.set_up();
  bench.pwm.set_duty(4, 0x456);
  bench.bus.reset_after(bench.chip, 2);
  EXPECT_EQ(bench.write(), Lines{"40 <- 18 NACK"});
  EXPECT_EQ(bench.pwm.trouble(), ChipTrouble::no_acknowledge);
  EXPECT_EQ(bench.chip.duty(4), 0);
}

TEST(Pca9685, NoticesAChangedRegister) {
  Pca9685Bench bench;
  bench.set_up();
  const std::uint8_t bytes[] = {0x06 + 4 * 7 + 2, 0x55};
  bench.bus.write(0x40, bytes, 2);
  for (int i = 0; i < Pca9685::channels; ++i) bench.verify();
  EXPECT_EQ(bench.pwm.trouble(), ChipTrouble::wrong_register);
}

TEST(Pca9685, DistinguishesAHeldBusFromASilentChip) {
  Pca9685Bench bench;
  bench.set_up();
  bench.bus.hold();
  bench.pwm.set_duty(0, 1);
  EXPECT_EQ(bench.write(), Lines{"40 <-  TIMEOUT"});
  EXPECT_EQ(bench.pwm.trouble(), ChipTrouble::bus_stuck);
}

RC_GTEST_PROP(Pca9685, PinsAreWhatTheyWereToldWhateverTheBudget,
              (const std::vector<std::array<std::uint16_t, 3>>& changes)) {
  const int distance = *rc::gen::inRange(0, partner_lines);
  const auto least = static_cast<std::size_t>(4 * (distance + 1) + 2);
  const auto budget = *rc::gen::inRange<std::size_t>(std::max<std::size_t>(least, 20), 80);
  Pca9685Bench bench;
  for (int i = 0; i + distance < Pca9685::channels; ++i) {
    if (i / std::max(distance, 1) % 2 == 0) bench.pwm.pair(i, i + distance);
  }
  bench.set_up();
  std::array<int, Pca9685::channels> duty{};
  for (const auto& [channel, value, kind] : changes) {
    const int at = channel % Pca9685::channels;
    const std::uint16_t to = kind % 4 == 0 ? 0 : kind % 4 == 1 ? 4095 : value % 4096;
    bench.pwm.set_duty(at, to);
    duty[static_cast<std::size_t>(at)] = to == 4095 ? 4096 : to;
    if (kind % 3 == 0) bench.write(budget);
  }
  for (int i = 0; i < 8; ++i) bench.write(budget);
  for (int i = 0; i < Pca9685::channels; ++i) {
    RC_ASSERT(bench.chip.duty(i) == duty[static_cast<std::size_t>(i)]);
  }
  RC_ASSERT(bench.write(budget).empty());
  for (int i = 0; i < Pca9685::channels; ++i) bench.verify();
  RC_ASSERT(bench.pwm.trouble() == ChipTrouble::none);
}

}  // namespace
}  // namespace r4::firmware
