// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/ports/sim/chips/mcp4728_model.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "firmware/ports/sim/chips/i2c_bus_model.hpp"

namespace r4::sim {
namespace {

using firmware::I2cResult;
using Bytes = std::vector<std::uint8_t>;

struct Mcp4728ModelBench {
  explicit Mcp4728ModelBench(bool ldac_low = false) : chip(0x61, ldac_low) { bus.attach(chip); }
  I2cResult write(const Bytes& bytes, std::uint8_t address = 0x61) {
    return bus.write(address, bytes.data(), bytes.size());
  }
  Bytes read(std::size_t size = 24) {
    Bytes bytes(size);
    EXPECT_EQ(bus.write_read(0x61, nullptr, 0, bytes.data(), size), I2cResult::ok);
    return bytes;
  }
  I2cBusModel bus;
  Mcp4728Model chip;
};

TEST(Mcp4728Model, FollowsTheSequentialWriteExampleOfTheDataSheet) {
  // Figure 7-4: A VDD/2; B full VDD; C 2.048 V reference, gain 2, half scale; D full scale.
  Mcp4728ModelBench bench;
  EXPECT_EQ(bench.write({0x50, 0x08, 0x00, 0x0F, 0xFF, 0x98, 0x00, 0x9F, 0xFF}), I2cResult::ok);
  EXPECT_NEAR(bench.chip.volts(0), 2.5, 1e-6);
  EXPECT_NEAR(bench.chip.volts(1), 5 - 5.0 / 4096, 1e-6);
  EXPECT_NEAR(bench.chip.volts(2), 2.048, 1e-6);
  EXPECT_NEAR(bench.chip.volts(3), 4.096 - 0.001, 1e-6);
  EXPECT_TRUE(bench.chip.busy());
  EXPECT_EQ(bench.read()[0], 0x41);
  bench.bus.advance(Mcp4728Model::eeprom_write_us);
  EXPECT_FALSE(bench.chip.busy());
  bench.chip.power_on();
  EXPECT_NEAR(bench.chip.volts(0), 2.5, 1e-6);
}

TEST(Mcp4728Model, IgnoresWritesWhileTheEepromIsWritten) {
  Mcp4728ModelBench bench;
  bench.write({0x5E, 0x01, 0x23});  // single write, channel D
  bench.write({0x40, 0x0F, 0xFF});
  EXPECT_EQ(bench.chip.output(0).code, 0);
  EXPECT_EQ(bench.chip.eeprom(3).code, 0x123);
  EXPECT_EQ(bench.chip.eeprom_writes(), 1);
}

TEST(Mcp4728Model, FastWriteWaitsForLdacOrTheGeneralCall) {
  Mcp4728ModelBench bench;
  bench.write({0x01, 0x00, 0x02, 0x00, 0x33, 0x00});
  EXPECT_EQ(bench.chip.input(1).code, 0x200);
  EXPECT_EQ(bench.chip.input(2).power_down, 3);
  EXPECT_EQ(bench.chip.output(1).code, 0);
  EXPECT_EQ(bench.write({0x08}, 0), I2cResult::ok);
  EXPECT_EQ(bench.chip.output(1).code, 0x200);
  Mcp4728ModelBench low(true);
  low.write({0x01, 0x00});
  EXPECT_EQ(low.chip.output(0).code, 0x100);
}

TEST(Mcp4728Model, MultiWriteRepeatsChannelAndDataAndUdacHoldsTheOutput) {
  Mcp4728ModelBench bench;
  bench.write({0x41, 0x01, 0x00, 0x06, 0x02, 0x00});
  EXPECT_EQ(bench.chip.input(0).code, 0x100);
  EXPECT_EQ(bench.chip.output(0).code, 0);
  EXPECT_EQ(bench.chip.output(3).code, 0x200);
  EXPECT_FALSE(bench.chip.output(3).internal_reference);
}

TEST(Mcp4728Model, ReferenceGainAndPowerDownHaveTheirOwnCommands) {
  Mcp4728ModelBench bench;
  bench.write({0x8A});
  EXPECT_TRUE(bench.chip.output(0).internal_reference);
  EXPECT_FALSE(bench.chip.output(1).internal_reference);
  bench.write({0xC1});
  EXPECT_TRUE(bench.chip.output(3).gain_2);
  bench.write({0xA1, 0xB0});
  EXPECT_EQ(bench.chip.output(0).power_down, 0);
  EXPECT_EQ(bench.chip.output(1).power_down, 1);
  EXPECT_EQ(bench.chip.output(2).power_down, 2);
  EXPECT_EQ(bench.chip.output(3).power_down, 3);
  EXPECT_EQ(bench.write({0x09}, 0), I2cResult::ok);
  EXPECT_EQ(bench.chip.output(3).power_down, 0);
}

TEST(Mcp4728Model, AGeneralCallResetLoadsTheEepromAndKeepsTheAddress) {
  Mcp4728ModelBench bench;
  bench.write({0x40, 0x0F, 0xFF});
  EXPECT_EQ(bench.write({0x06}, 0), I2cResult::ok);
  EXPECT_EQ(bench.chip.output(0).code, 0);
  EXPECT_TRUE(bench.chip.output(0).internal_reference);
  EXPECT_EQ(bench.write({0x61, 0x62, 0x63}), I2cResult::no_acknowledge);
}

TEST(Mcp4728Model, ReadsInputRegistersAndEepromOfAllChannelsInTurn) {
  Mcp4728ModelBench bench;
  bench.write({0x42, 0x0A, 0xBC});
  EXPECT_EQ(bench.read(), (Bytes{0xC1, 0x80, 0, 0xC1, 0x80, 0, 0xD1, 0x0A, 0xBC, 0xD1, 0x80, 0,
                                 0xE1, 0x80, 0, 0xE1, 0x80, 0, 0xF1, 0x80, 0,    0xF1, 0x80, 0}));
}

}  // namespace
}  // namespace r4::sim
