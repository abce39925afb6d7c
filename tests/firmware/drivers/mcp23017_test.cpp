// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/drivers/mcp23017.hpp"

#include <gtest/gtest.h>

#include "bus_log.hpp"
#include "firmware/ports/sim/chips/mcp23017_model.hpp"

namespace r4::firmware {
namespace {

using sim::Mcp23017Model;
using Lines = std::vector<std::string>;

constexpr std::uint8_t safe_a = 0xAA;
constexpr std::uint8_t safe_b = 0x00;

struct Mcp23017Bench {
  Mcp23017Bench() { bus.attach(chip); }
  void set_up() {
    expander.begin();
    test::run(expander, bus, 1);
    ASSERT_TRUE(expander.ready());
    log.clear();
  }
  Lines write(std::uint8_t a, std::uint8_t b) {
    log.clear();
    expander.set_ports(static_cast<std::uint16_t>(b << 8 | a));
    BusBudget budget(48);
    expander.write_changes(budget);
    return test::lines(log);
  }
  ChipTrouble verify() {
    BusBudget budget(48);
    expander.verify(budget);
    return expander.trouble();
  }
  sim::I2cBusModel bus;
  test::BusLog log{bus};
  Mcp23017Model chip{0x20};
  Mcp23017 expander{bus, 0x20, 0xFFFF, safe_b << 8 | safe_a};
};

TEST(Mcp23017, WritesTheLatchesBeforeTheDirections) {
  Mcp23017Bench bench;
  bench.expander.begin();
  test::run(bench.expander, bench.bus, 1);
  EXPECT_EQ(test::lines(bench.log),
            (Lines{"20 <- 05 00", "20 <- 14 AA 00", "20 <- 00 00 00 00 00", "20 <- 0A 00"}));
  EXPECT_EQ(bench.chip.driven(0), 0xFF);
  EXPECT_EQ(bench.chip.driven(1), 0xFF);
  EXPECT_EQ(bench.chip.level(0), safe_a);
  EXPECT_EQ(bench.chip.level(1), safe_b);
}

TEST(Mcp23017, SetUpDrivesEveryPinOnlyToItsSafeLevel) {
  Mcp23017Bench bench;
  bench.expander.begin();
  for (int i = 0; i < 10; ++i) {
    BusBudget budget(6);
    bench.expander.poll(0, budget);
    EXPECT_EQ(bench.chip.level(0) & bench.chip.driven(0), safe_a & bench.chip.driven(0));
    EXPECT_EQ(bench.chip.level(1) & bench.chip.driven(1), safe_b & bench.chip.driven(1));
  }
  EXPECT_TRUE(bench.expander.ready());
}

TEST(Mcp23017, SetsUpAChipInTheOtherRegisterLayout) {
  Mcp23017Bench bench;
  const std::uint8_t bank[] = {0x0A, 0x80};
  bench.bus.write(0x20, bank, 2);
  bench.set_up();
  EXPECT_EQ(bench.chip.level(0), safe_a);
  EXPECT_EQ(bench.chip.driven(0), 0xFF);
  EXPECT_EQ(bench.verify(), ChipTrouble::none);
}

TEST(Mcp23017, WritesOnlyTheLatchThatChanged) {
  Mcp23017Bench bench;
  bench.set_up();
  EXPECT_EQ(bench.write(safe_a, safe_b), Lines{});
  EXPECT_EQ(bench.write(safe_a, 0x81), Lines{"20 <- 15 81"});
  EXPECT_EQ(bench.write(0x55, 0x81), Lines{"20 <- 14 55"});
  EXPECT_EQ(bench.write(0x01, 0x02), Lines{"20 <- 14 01 02"});
  EXPECT_EQ(bench.chip.level(0), 0x01);
  EXPECT_EQ(bench.chip.level(1), 0x02);
  EXPECT_EQ(bench.write(0x01, 0x02), Lines{});
  EXPECT_EQ(bench.verify(), ChipTrouble::none);
}

TEST(Mcp23017, TheSafeStateWorksOnAChipThatWasReset) {
  Mcp23017Bench bench;
  bench.set_up();
  bench.write(0x55, 0xFF);
  bench.chip.power_on();
  bench.log.clear();
  EXPECT_EQ(bench.expander.make_safe(), I2cResult::ok);
  EXPECT_EQ(test::lines(bench.log), (Lines{"20 <- 14 AA 00", "20 <- 00 00 00"}));
  EXPECT_EQ(bench.chip.level(0), safe_a);
  EXPECT_EQ(bench.chip.level(1), safe_b);
  EXPECT_EQ(bench.chip.driven(0), 0xFF);
}

TEST(Mcp23017, NoticesAReset) {
  Mcp23017Bench bench;
  bench.set_up();
  bench.chip.power_on();
  EXPECT_EQ(bench.verify(), ChipTrouble::was_reset);
}

TEST(Mcp23017, NoticesAChangedLatchOrDirection) {
  for (const int number : {0x00, 0x01, 0x14, 0x15}) {
    Mcp23017Bench bench;
    bench.set_up();
    const std::uint8_t bytes[] = {static_cast<std::uint8_t>(number), 0x21};
    bench.bus.write(0x20, bytes, 2);
    EXPECT_EQ(bench.verify(), ChipTrouble::wrong_register) << number;
  }
}

TEST(Mcp23017, ReportsRefusedBytesAndAHeldBus) {
  Mcp23017Bench bench;
  bench.set_up();
  bench.bus.refuse(0x20, 1);
  EXPECT_EQ(bench.write(1, 2), Lines{"20 <- 14 NACK"});
  EXPECT_EQ(bench.expander.trouble(), ChipTrouble::no_acknowledge);
  bench.set_up();
  bench.bus.hold();
  bench.write(1, 2);
  EXPECT_EQ(bench.expander.trouble(), ChipTrouble::bus_stuck);
}

}  // namespace
}  // namespace r4::firmware
