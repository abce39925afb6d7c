// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/ports/sim/chips/i2c_bus_model.hpp"

#include <gtest/gtest.h>

#include <deque>

namespace r4::sim {
namespace {

using firmware::I2cResult;

// Answers to one address, remembers and counts.
struct Memory final : I2cChipModel {
  explicit Memory(std::uint8_t at) : address(at) {}
  void power_on() override { ++power_ons; }
  bool start(std::uint8_t at, bool) override { return at == address; }
  bool write(std::uint8_t byte) override {
    bytes.push_back(byte);
    return true;
  }
  std::uint8_t read() override { return next++; }
  void stop() override { ++stops; }
  std::uint8_t address;
  std::deque<std::uint8_t> bytes;
  std::uint8_t next = 1;
  int power_ons = 0;
  int stops = 0;
};

struct Bench {
  Bench() { bus.attach(chip); }
  I2cResult write(std::vector<std::uint8_t> bytes, std::uint8_t address = 0x11) {
    return bus.write(address, bytes.data(), bytes.size());
  }
  I2cBusModel bus;
  Memory chip{0x11};
};

TEST(I2cBusModel, ATransferTakesItsClocksAt400Kilohertz) {
  Bench bench;
  EXPECT_EQ(bench.write({1, 2}), I2cResult::ok);
  const I2cTransfer& write = bench.bus.log().back();
  EXPECT_EQ(write.bytes, 3U);
  EXPECT_EQ(write.duration_ns, (3 * 9 + 2) * 2500U);
  EXPECT_EQ(write.duration_ns / 1000, firmware::i2c_wire_us(3));
  const std::uint8_t out = 7;
  std::uint8_t in[2] = {};
  EXPECT_EQ(bench.bus.write_read(0x11, &out, 1, in, 2), I2cResult::ok);
  const I2cTransfer& read = bench.bus.log().back();
  EXPECT_EQ(read.bytes, 5U);
  EXPECT_EQ(read.duration_ns, (5 * 9 + 3) * 2500U);
  EXPECT_EQ(read.read, (std::vector<std::uint8_t>{1, 2}));
  EXPECT_EQ(bench.chip.stops, 2);
}

TEST(I2cBusModel, NobodyAtAnAddressIsNoAcknowledge) {
  Bench bench;
  EXPECT_EQ(bench.write({1}, 0x12), I2cResult::no_acknowledge);
  EXPECT_EQ(bench.bus.log().back().bytes, 1U);
  std::uint8_t in = 0;
  EXPECT_EQ(bench.bus.write_read(0x12, nullptr, 0, &in, 1), I2cResult::no_acknowledge);
}

TEST(I2cBusModel, RefusesAfterAsManyBytesAsAsked) {
  Bench bench;
  bench.bus.refuse(0x11, 0);
  EXPECT_EQ(bench.write({1, 2, 3}), I2cResult::no_acknowledge);
  EXPECT_TRUE(bench.chip.bytes.empty());
  bench.bus.refuse(0x11, 2);
  EXPECT_EQ(bench.write({1, 2, 3}), I2cResult::no_acknowledge);
  EXPECT_EQ(bench.chip.bytes, (std::deque<std::uint8_t>{1, 2}));
  EXPECT_EQ(bench.write({9}), I2cResult::ok);
}

TEST(I2cBusModel, AHeldBusTimesOutUntilItIsRecovered) {
  Bench bench;
  bench.bus.hold(2);
  const std::uint64_t began = bench.bus.now_us();
  EXPECT_EQ(bench.write({1}), I2cResult::timeout);
  EXPECT_LE(bench.bus.now_us() - began, firmware::i2c_timeout_us + 10U);
  EXPECT_FALSE(bench.bus.recover());
  EXPECT_TRUE(bench.bus.recover());
  EXPECT_EQ(bench.write({1}), I2cResult::ok);
}

TEST(I2cBusModel, MayBeHeldInTheMiddleOfATransfer) {
  Bench bench;
  bench.bus.hold_after(2);
  EXPECT_EQ(bench.write({1, 2, 3}), I2cResult::timeout);
  EXPECT_EQ(bench.chip.bytes.size(), 1U);
  EXPECT_EQ(bench.chip.stops, 0);
}

TEST(I2cBusModel, AChipThatIsResetInATransferIsOutOfIt) {
  Bench bench;
  bench.bus.reset_after(bench.chip, 2);
  EXPECT_EQ(bench.write({1, 2, 3}), I2cResult::no_acknowledge);
  EXPECT_EQ(bench.chip.power_ons, 2);
  EXPECT_EQ(bench.chip.bytes, (std::deque<std::uint8_t>{1}));
  EXPECT_EQ(bench.write({5}), I2cResult::ok);
  std::uint8_t in[2] = {};
  bench.bus.reset_after(bench.chip, 2);
  EXPECT_EQ(bench.bus.write_read(0x11, nullptr, 0, in, 2), I2cResult::ok);
  EXPECT_EQ(in[1], 0xFF);  // nobody pulls SDA down
}

}  // namespace
}  // namespace r4::sim
