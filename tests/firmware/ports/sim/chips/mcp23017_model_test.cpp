// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/ports/sim/chips/mcp23017_model.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "firmware/ports/sim/chips/i2c_bus_model.hpp"

namespace r4::sim {
namespace {

using Bytes = std::vector<std::uint8_t>;
using Register = Mcp23017Model::Register;

struct Mcp23017ModelBench {
  Mcp23017ModelBench() { bus.attach(chip); }
  void write(const Bytes& bytes) { bus.write(0x20, bytes.data(), bytes.size()); }
  Bytes read(std::uint8_t first, std::size_t size) {
    Bytes bytes(size);
    bus.write_read(0x20, &first, 1, bytes.data(), size);
    return bytes;
  }
  I2cBusModel bus;
  Mcp23017Model chip{0x20};
};

TEST(Mcp23017Model, IsAllInputsAfterPowerOn) {
  Mcp23017ModelBench bench;
  Bytes expected(22, 0);
  expected[0] = expected[1] = 0xFF;
  EXPECT_EQ(bench.read(0, 22), expected);
  EXPECT_EQ(bench.chip.driven(0), 0);
}

TEST(Mcp23017Model, TheAddressIncrementsAndRollsOverToZero) {
  Mcp23017ModelBench bench;
  bench.write({0x14, 0x0F, 0xF0, 0x00, 0x33});
  EXPECT_EQ(bench.chip.reg(0, Register::olat), 0x0F);
  EXPECT_EQ(bench.chip.reg(1, Register::olat), 0xF0);
  EXPECT_EQ(bench.chip.reg(0, Register::iodir), 0x00);
  EXPECT_EQ(bench.chip.reg(1, Register::iodir), 0x33);
  EXPECT_EQ(bench.chip.level(0), 0x0F);
  EXPECT_EQ(bench.chip.level(1), 0xC0);  // inputs show the outside level
}

TEST(Mcp23017Model, ByteModeAlternatesBetweenTheTwoPorts) {
  Mcp23017ModelBench bench;
  bench.write({0x0A, 0x20});
  bench.write({0x14, 1, 2, 3});
  EXPECT_EQ(bench.chip.reg(0, Register::olat), 3);
  EXPECT_EQ(bench.chip.reg(1, Register::olat), 2);
}

TEST(Mcp23017Model, BankSeparatesThePorts) {
  Mcp23017ModelBench bench;
  bench.write({0x0A, 0x80});
  bench.write({0x00, 0x00});
  bench.write({0x0A, 0x11});
  bench.write({0x10, 0x0F});
  bench.write({0x1A, 0x22});
  EXPECT_EQ(bench.chip.reg(0, Register::iodir), 0x00);
  EXPECT_EQ(bench.chip.reg(0, Register::olat), 0x11);
  EXPECT_EQ(bench.chip.reg(1, Register::iodir), 0x0F);
  EXPECT_EQ(bench.chip.reg(1, Register::olat), 0x22);
  bench.write({0x05, 0x00});
  EXPECT_EQ(bench.read(0x15, 1), Bytes{0x22});
}

TEST(Mcp23017Model, FollowsPullUpsInversionAndWritesToThePort) {
  Mcp23017ModelBench bench;
  bench.chip.set_outside(0, 0x05);
  EXPECT_EQ(bench.read(0x12, 1), Bytes{0x05});
  bench.write({0x0C, 0x80});
  bench.write({0x02, 0x01});
  EXPECT_EQ(bench.read(0x12, 1), Bytes{0x84});
  bench.write({0x12, 0x3C});
  EXPECT_EQ(bench.chip.reg(0, Register::olat), 0x3C);
  bench.write({0x0E, 0xFF, 0xFF, 0xFF, 0xFF});
  EXPECT_EQ(bench.read(0x0E, 4), (Bytes{0, 0, 0, 0}));
}

}  // namespace
}  // namespace r4::sim
