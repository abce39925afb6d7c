// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/ports/sim/chips/i2c_bus_model.hpp"

#include <gtest/gtest.h>

#include <deque>
#include <functional>
#include <utility>
#include <vector>

#include "tests/firmware/drivers/bus_log.hpp"

namespace r4::sim {
namespace {

using firmware::I2cResult;

// A chip at one address that keeps the bytes and counts the stops.
struct Memory final : I2cChipModel {
  explicit Memory(std::uint8_t at) : address(at) {}
  void power_on() override { ++power_ons; }
  bool start(std::uint8_t at, bool) override { return at == address; }
  bool write(std::uint8_t byte) override {
    bytes.push_back(byte);
    interrupt();
    return true;
  }
  std::uint8_t read() override {
    interrupt();
    return next++;
  }
  // Runs on_byte once, in the middle of a byte.
  void interrupt() {
    if (const auto handler = std::exchange(on_byte, nullptr)) handler();
  }
  void stop() override { ++stops; }
  std::uint8_t address;
  std::deque<std::uint8_t> bytes;
  std::uint8_t next = 1;
  int power_ons = 0;
  int stops = 0;
  std::function<void()> on_byte;
};

struct I2cBusModelBench {
  I2cBusModelBench() { bus.attach(chip); }
  I2cResult write(std::vector<std::uint8_t> bytes, std::uint8_t address = 0x11) {
    return bus.write(address, bytes.data(), bytes.size());
  }
  I2cBusModel bus;
  test::BusLog log{bus};
  Memory chip{0x11};
};

TEST(I2cBusModel, ATransferTakesItsTimeAt400Kilohertz) {
  I2cBusModelBench bench;
  EXPECT_EQ(bench.write({1, 2}), I2cResult::ok);
  const test::BusLog::Transfer write = bench.log.transfers().back();
  EXPECT_EQ(write.bytes, 3U);
  EXPECT_EQ(write.duration_ns, (3 * 9 + 2) * 2500U);
  EXPECT_EQ(write.duration_ns / 1000, firmware::i2c_wire_us(3));
  const std::uint8_t out = 7;
  std::uint8_t in[2] = {};
  EXPECT_EQ(bench.bus.write_read(0x11, &out, 1, in, 2), I2cResult::ok);
  const test::BusLog::Transfer read = bench.log.transfers().back();
  EXPECT_EQ(read.bytes, 5U);
  EXPECT_EQ(read.duration_ns, (5 * 9 + 3) * 2500U);
  EXPECT_EQ(read.read, (std::vector<std::uint8_t>{1, 2}));
  EXPECT_EQ(bench.chip.stops, 2);
}

TEST(I2cBusModel, AnUnusedAddressIsNotAcknowledged) {
  I2cBusModelBench bench;
  EXPECT_EQ(bench.write({1}, 0x12), I2cResult::no_acknowledge);
  EXPECT_EQ(bench.log.transfers().back().bytes, 1U);
  std::uint8_t in = 0;
  EXPECT_EQ(bench.bus.write_read(0x12, nullptr, 0, &in, 1), I2cResult::no_acknowledge);
}

TEST(I2cBusModel, RefusesAfterTheSetNumberOfBytes) {
  I2cBusModelBench bench;
  bench.bus.refuse(0x11, 0);
  EXPECT_EQ(bench.write({1, 2, 3}), I2cResult::no_acknowledge);
  EXPECT_TRUE(bench.chip.bytes.empty());
  bench.bus.refuse(0x11, 2);
  EXPECT_EQ(bench.write({1, 2, 3}), I2cResult::no_acknowledge);
  EXPECT_EQ(bench.chip.bytes, (std::deque<std::uint8_t>{1, 2}));
  EXPECT_EQ(bench.write({9}), I2cResult::ok);
}

TEST(I2cBusModel, AHeldBusTimesOutUntilItIsRecovered) {
  I2cBusModelBench bench;
  bench.bus.hold(2);
  const std::uint64_t began = bench.bus.now_us();
  EXPECT_EQ(bench.write({1}), I2cResult::timeout);
  EXPECT_LE(bench.bus.now_us() - began, firmware::i2c_timeout_us + 10U);
  EXPECT_FALSE(bench.bus.recover());
  EXPECT_TRUE(bench.bus.recover());
  EXPECT_EQ(bench.write({1}), I2cResult::ok);
}

TEST(I2cBusModel, MayBeHeldInTheMiddleOfATransfer) {
  I2cBusModelBench bench;
  bench.bus.hold_after(2);
  EXPECT_EQ(bench.write({1, 2, 3}), I2cResult::timeout);
  EXPECT_EQ(bench.chip.bytes.size(), 1U);
  EXPECT_EQ(bench.chip.stops, 0);
}

TEST(I2cBusModel, AChipResetDuringATransferLeavesTheTransfer) {
  I2cBusModelBench bench;
  bench.bus.reset_after(bench.chip, 2);
  EXPECT_EQ(bench.write({1, 2, 3}), I2cResult::no_acknowledge);
  EXPECT_EQ(bench.chip.power_ons, 2);
  EXPECT_EQ(bench.chip.bytes, (std::deque<std::uint8_t>{1}));
  EXPECT_EQ(bench.write({5}), I2cResult::ok);
  std::uint8_t in[2] = {};
  bench.bus.reset_after(bench.chip, 2);
  EXPECT_EQ(bench.bus.write_read(0x11, nullptr, 0, in, 2), I2cResult::ok);
  EXPECT_EQ(in[1], 0xFF);  // no chip pulls SDA low
}

TEST(I2cBusModel, ARecoverySendsAStopConditionToTheCutOffChip) {
  I2cBusModelBench bench;
  bench.bus.hold_after(2, 2);
  EXPECT_EQ(bench.write({1, 2, 3}), I2cResult::timeout);
  EXPECT_FALSE(bench.bus.recover());
  EXPECT_EQ(bench.chip.stops, 0);
  EXPECT_TRUE(bench.bus.recover());
  EXPECT_EQ(bench.chip.stops, 1);
}

TEST(I2cBusModel, AnInterruptingTransferCutsATransferShort) {
  I2cBusModelBench bench;
  Memory other(0x22);
  bench.bus.attach(other);
  std::vector<std::uint8_t> in(2);
  bench.chip.on_byte = [&] {
    EXPECT_TRUE(bench.bus.recover());
    EXPECT_EQ(bench.write({7, 8}, 0x22), I2cResult::ok);
    EXPECT_EQ(bench.bus.write_read(0x22, nullptr, 0, in.data(), in.size()), I2cResult::ok);
  };
  EXPECT_EQ(bench.write({1, 2, 3}), I2cResult::timeout);
  EXPECT_EQ(bench.chip.bytes, (std::deque<std::uint8_t>{1}));
  EXPECT_EQ(other.bytes, (std::deque<std::uint8_t>{7, 8}));
  EXPECT_EQ(other.stops, 2);
  EXPECT_EQ(bench.chip.stops, 1);  // the recovery ends with a stop
  const auto& all = bench.log.transfers();
  ASSERT_EQ(all.size(), 4U);
  EXPECT_EQ(all.back().result, I2cResult::timeout);
  // The interrupted transfer takes the time of the other transfers and of its own two bytes, and
  // does not wait for a held line.
  EXPECT_EQ(all.back().duration_ns,
            all[0].duration_ns + all[1].duration_ns + all[2].duration_ns + (9 + 1) * 2500U);
  EXPECT_EQ(bench.write({4}), I2cResult::ok);
  EXPECT_EQ(bench.chip.stops, 2);
}

TEST(I2cBusModel, AnInterruptingTransferCutsAReadShort) {
  I2cBusModelBench bench;
  const std::uint8_t out = 1;
  std::uint8_t in[3] = {};
  bench.chip.on_byte = [&] {
    bench.chip.on_byte = [&] { EXPECT_EQ(bench.write({5}), I2cResult::ok); };
  };
  EXPECT_EQ(bench.bus.write_read(0x11, &out, 1, in, sizeof in), I2cResult::timeout);
  EXPECT_EQ(bench.chip.next, 2);
  EXPECT_EQ(bench.chip.bytes, (std::deque<std::uint8_t>{1, 5}));
}

TEST(I2cBusModel, AnInterruptCutsOffEveryChipAtAnAddress) {
  I2cBusModelBench bench;
  Memory twin(0x11);
  bench.bus.attach(twin);
  bench.chip.on_byte = [&] { bench.bus.recover(); };
  EXPECT_EQ(bench.write({1, 2}), I2cResult::timeout);
  EXPECT_TRUE(twin.bytes.empty());
  EXPECT_EQ(twin.stops, 1);
}

struct ProcessorModel final : I2cProcessor {
  std::uint32_t hold_interrupts() override {
    ++held;
    return depth++;
  }
  void release_interrupts(std::uint32_t before) override { EXPECT_EQ(before, --depth); }
  void wait(std::uint32_t ns) override {
    EXPECT_EQ(depth, 0U);
    waited_ns += ns;
    if (const auto handler = std::exchange(on_wait, nullptr)) handler();
  }
  int held = 0;
  std::uint32_t depth = 0;
  std::uint64_t waited_ns = 0;
  std::function<void()> on_wait;
};

TEST(I2cBusModel, InterruptsComeOnlyBetweenBytes) {
  I2cBusModelBench bench;
  ProcessorModel processor;
  bench.bus.set_processor(&processor);
  bench.chip.on_byte = [&] { EXPECT_EQ(processor.depth, 1U); };
  bench.write({1, 2, 3});
  EXPECT_EQ(processor.depth, 0U);
  EXPECT_EQ(processor.held, 6);  // begin, START, three bytes, end
}

TEST(I2cBusModel, TheProcessorWaitsOnlyWhileTheBusIsBusy) {
  I2cBusModelBench bench;
  ProcessorModel processor;
  bench.bus.set_processor(&processor);
  bench.write({1, 2, 3});
  EXPECT_EQ(processor.waited_ns, bench.log.transfers().back().duration_ns);
  bench.bus.advance(1000);
  EXPECT_EQ(processor.waited_ns, bench.log.transfers().back().duration_ns);
  bench.bus.hold();
  bench.write({1});
  EXPECT_GE(processor.waited_ns, firmware::i2c_timeout_us * 1000);
}

TEST(I2cBusModel, AnInterruptWhileTheProcessorWaitsCutsTheTransferShort) {
  I2cBusModelBench bench;
  ProcessorModel processor;
  bench.bus.set_processor(&processor);
  processor.on_wait = [&] { EXPECT_EQ(bench.write({7}), I2cResult::ok); };
  EXPECT_EQ(bench.write({1, 2}), I2cResult::timeout);
  EXPECT_EQ(bench.chip.bytes, (std::deque<std::uint8_t>{7}));
}

TEST(I2cBusModel, RefusesMoreChipsAndErrorsThanItsMaximum) {
  I2cBusModel bus;
  std::deque<Memory> chips;
  for (std::uint8_t i = 0; i <= I2cBusModel::max_chips; ++i) {
    chips.emplace_back(i);
    EXPECT_EQ(bus.attach(chips.back()), i < I2cBusModel::max_chips);
  }
  for (int i = 0; i <= I2cBusModel::max_errors; ++i) {
    EXPECT_EQ(bus.refuse(3), i < I2cBusModel::max_errors);
    EXPECT_EQ(bus.reset_after(chips[0], 100), i < I2cBusModel::max_errors);
  }
  const std::uint8_t byte = 0;
  for (int i = 0; i <= I2cBusModel::max_errors; ++i) {
    const I2cResult expected =
        i < I2cBusModel::max_errors ? I2cResult::no_acknowledge : I2cResult::ok;
    EXPECT_EQ(bus.write(3, &byte, 1), expected);
  }
  EXPECT_TRUE(bus.refuse(3));
  bus.clear_errors();
  EXPECT_EQ(bus.write(3, &byte, 1), I2cResult::ok);
}

}  // namespace
}  // namespace r4::sim
