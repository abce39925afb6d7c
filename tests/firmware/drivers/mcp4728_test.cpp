// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/drivers/mcp4728.hpp"

#include <gtest/gtest.h>

#include "bus_log.hpp"
#include "firmware/ports/sim/chips/mcp4728_model.hpp"

namespace r4::firmware {
namespace {

using sim::Mcp4728Model;
using Lines = std::vector<std::string>;

const std::string zeros = "61 <- 40 00 00 42 00 00 44 00 00 46 00 00";
const std::string factory_eeprom =
    "61 -> C1 00 00 C1 80 00 D1 00 00 D1 80 00 E1 00 00 E1 80 00 F1 00 00 F1 80 00";
const std::string zero_eeprom =
    "61 -> C1 00 00 C1 00 00 D1 00 00 D1 00 00 E1 00 00 E1 00 00 F1 00 00 F1 00 00";

struct Mcp4728Bench {
  Mcp4728Bench() { bus.attach(chip); }
  void provisioned() {
    for (int i = 0; i < Mcp4728::channels; ++i) chip.set_eeprom(i, {});
    chip.power_on();
  }
  void set_up(int ms = 1) {
    dac.begin();
    test::run(dac, bus, ms);
    ASSERT_TRUE(dac.ready());
    log.clear();
  }
  Lines write() {
    log.clear();
    BusBudget budget(48);
    dac.write_changes(budget);
    return test::lines(log);
  }
  ChipTrouble verify() {
    BusBudget budget(48);
    dac.verify(budget);
    return dac.trouble();
  }
  sim::I2cBusModel bus;
  test::BusLog log{bus};
  Mcp4728Model chip{0x61};
  Mcp4728 dac{bus, 0x61};
};

TEST(Mcp4728, ProvisionsTheEepromOfANewChipWithZerosOnce) {
  Mcp4728Bench bench;
  bench.dac.begin();
  test::run(bench.dac, bench.bus, 70);
  EXPECT_TRUE(bench.dac.ready());
  const Lines all = test::lines(bench.log);
  ASSERT_GT(all.size(), 6U);
  EXPECT_EQ(all[0], zeros);
  EXPECT_EQ(all[1], factory_eeprom);
  EXPECT_EQ(all[2], "61 <- 50 00 00 00 00 00 00 00 00");
  EXPECT_EQ(all[3].substr(0, 8), "61 -> 41");  // the chip is busy
  EXPECT_EQ(all[all.size() - 2], zeros);
  EXPECT_EQ(all.back(), zero_eeprom);
  EXPECT_EQ(bench.chip.eeprom_writes(), 1);
  EXPECT_EQ(bench.dac.eeprom_writes(), 1);
  for (int i = 0; i < Mcp4728::channels; ++i) {
    EXPECT_EQ(bench.chip.eeprom(i), Mcp4728Model::Setting());
    EXPECT_EQ(bench.chip.output(i), Mcp4728Model::Setting());
  }
  bench.set_up();
  EXPECT_EQ(bench.chip.eeprom_writes(), 1);
}

TEST(Mcp4728, LeavesAProvisionedEepromAlone) {
  Mcp4728Bench bench;
  bench.provisioned();
  bench.dac.begin();
  test::run(bench.dac, bench.bus, 1);
  EXPECT_EQ(test::lines(bench.log), (Lines{zeros, zero_eeprom}));
  EXPECT_TRUE(bench.dac.ready());
  EXPECT_EQ(bench.chip.eeprom_writes(), 0);
}

TEST(Mcp4728, DoesNotRewriteAnEepromThatKeepsNothing) {
  Mcp4728Bench bench;
  bench.chip.wear_out();
  for (int i = 0; i < 5; ++i) {
    bench.dac.begin();
    test::run(bench.dac, bench.bus, 200);
    EXPECT_EQ(bench.dac.trouble(), ChipTrouble::not_ready);
  }
  EXPECT_EQ(bench.chip.eeprom_writes(), 1);
}

TEST(Mcp4728, WaitsForAnEepromWriteInProgressAtBoot) {
  Mcp4728Bench bench;
  const std::uint8_t provision[] = {0x50, 0, 0, 0, 0, 0, 0, 0, 0};
  bench.bus.write(0x61, provision, sizeof provision);
  bench.dac.begin();
  test::run(bench.dac, bench.bus, 40);
  EXPECT_FALSE(bench.dac.ready());
  test::run(bench.dac, bench.bus, 30);
  EXPECT_TRUE(bench.dac.ready());
  EXPECT_EQ(bench.chip.eeprom_writes(), 1);
}

TEST(Mcp4728, WritesOnlyTheChannelsThatChanged) {
  Mcp4728Bench bench;
  bench.provisioned();
  bench.set_up();
  bench.dac.set_code(1, 0xABC);
  EXPECT_EQ(bench.write(), Lines{"61 <- 42 0A BC"});
  bench.dac.set_code(0, 1);
  bench.dac.set_code(3, 9999);
  EXPECT_EQ(bench.write(), Lines{"61 <- 40 00 01 46 0F FF"});
  EXPECT_EQ(bench.write(), Lines{});
  EXPECT_EQ(bench.chip.output(0).code, 1);
  EXPECT_EQ(bench.chip.output(1).code, 0xABC);
  EXPECT_EQ(bench.chip.output(2).code, 0);
  EXPECT_EQ(bench.chip.output(3).code, 4095);
  EXPECT_NEAR(bench.chip.volts(3), 5.0, 0.01);
  EXPECT_EQ(bench.verify(), ChipTrouble::none);
}

TEST(Mcp4728, TheSafeStateIsZeroVoltsOnAllChannels) {
  Mcp4728Bench bench;
  bench.provisioned();
  bench.set_up();
  for (int i = 0; i < Mcp4728::channels; ++i) bench.dac.set_code(i, 4095);
  bench.write();
  bench.log.clear();
  EXPECT_EQ(bench.dac.make_safe(), I2cResult::ok);
  EXPECT_EQ(test::lines(bench.log), Lines{zeros});
  for (int i = 0; i < Mcp4728::channels; ++i) EXPECT_EQ(bench.chip.volts(i), 0);
  EXPECT_EQ(bench.write(), Lines{});
}

TEST(Mcp4728, NoticesAResetAndAWrongRegister) {
  Mcp4728Bench bench;
  bench.provisioned();
  bench.set_up();
  bench.dac.set_code(2, 100);
  bench.write();
  bench.chip.power_on();
  EXPECT_EQ(bench.verify(), ChipTrouble::was_reset);
  bench.set_up();
  bench.dac.set_code(2, 100);
  bench.write();
  const std::uint8_t bytes[] = {0x44, 0x00, 0x65};
  bench.bus.write(0x61, bytes, 3);
  EXPECT_EQ(bench.verify(), ChipTrouble::wrong_register);
}

TEST(Mcp4728, ReportsRefusedBytesAndAHeldBus) {
  Mcp4728Bench bench;
  bench.provisioned();
  bench.set_up();
  bench.dac.set_code(0, 100);
  bench.bus.refuse(0x61, 2);
  EXPECT_EQ(bench.write(), Lines{"61 <- 40 00 NACK"});
  EXPECT_EQ(bench.dac.trouble(), ChipTrouble::no_acknowledge);
  EXPECT_EQ(bench.chip.output(0).code, 0);
  bench.set_up();
  bench.bus.hold();
  EXPECT_EQ(bench.verify(), ChipTrouble::bus_stuck);
}

}  // namespace
}  // namespace r4::firmware
