// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/ports/sim/chips/pca9685_model.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "firmware/ports/sim/chips/i2c_bus_model.hpp"

namespace r4::sim {
namespace {

using firmware::I2cResult;
using Bytes = std::vector<std::uint8_t>;

struct Pca9685ModelBench {
  Pca9685ModelBench() { bus.attach(chip); }
  I2cResult write(const Bytes& bytes, std::uint8_t address = 0x40) {
    return bus.write(address, bytes.data(), bytes.size());
  }
  Bytes read(std::uint8_t first, std::size_t size) {
    Bytes bytes(size);
    EXPECT_EQ(bus.write_read(0x40, &first, 1, bytes.data(), size), I2cResult::ok);
    return bytes;
  }
  void wake() {
    write({0x00, 0x21});
    bus.advance(600);
  }
  I2cBusModel bus;
  Pca9685Model chip{0x40};
};

TEST(Pca9685Model, HasTheDataSheetsValuesAfterPowerOn) {
  Pca9685ModelBench bench;
  EXPECT_EQ(bench.read(0x00, 1), Bytes{0x11});
  EXPECT_EQ(bench.read(0x01, 1), Bytes{0x04});
  EXPECT_EQ(bench.read(0x02, 1), Bytes{0xE2});
  EXPECT_EQ(bench.read(0x03, 1), Bytes{0xE4});
  EXPECT_EQ(bench.read(0x04, 1), Bytes{0xE8});
  EXPECT_EQ(bench.read(0x05, 1), Bytes{0xE0});
  EXPECT_EQ(bench.read(0xFE, 1), Bytes{0x1E});
  bench.write({0x00, 0x31});
  const Bytes leds = bench.read(0x06, 64);
  for (std::size_t i = 0; i < leds.size(); ++i) EXPECT_EQ(leds[i], i % 4 == 3 ? 0x10 : 0);
}

TEST(Pca9685Model, TheAddressIncrementsOnlyWithAutoIncrementAndWraps) {
  Pca9685ModelBench bench;
  bench.write({0x06, 0x01, 0x02, 0x03});
  EXPECT_EQ(bench.chip.reg(0x06), 0x03);
  EXPECT_EQ(bench.chip.reg(0x07), 0x00);
  bench.write({0x00, 0x31});
  bench.write({0x45, 0x05, 0x31, 0x04});
  EXPECT_EQ(bench.chip.reg(0x45), 0x05);
  EXPECT_EQ(bench.chip.reg(0x01), 0x04);
  bench.write({0xFD, 0x10, 0x05, 0x35});
  EXPECT_EQ(bench.chip.reg(0xFE), 0x05);
  EXPECT_EQ(bench.chip.reg(0x00), 0x35);
}

TEST(Pca9685Model, AutoIncrementAppliesWithinTheTransferThatSetsIt) {
  Pca9685ModelBench bench;
  bench.write({0x00, 0x31, 0x14});
  EXPECT_EQ(bench.chip.reg(0x01), 0x14);
}

TEST(Pca9685Model, RefusesReservedRegisters) {
  Pca9685ModelBench bench;
  EXPECT_EQ(bench.write({0x46, 1}), I2cResult::no_acknowledge);
  EXPECT_EQ(bench.write({0xF9, 1}), I2cResult::no_acknowledge);
}

TEST(Pca9685Model, AcceptsAPrescaleOnlyInSleepAndAtLeastThree) {
  Pca9685ModelBench bench;
  bench.write({0xFE, 0x79});
  EXPECT_EQ(bench.chip.reg(0xFE), 0x79);
  bench.write({0xFE, 0x01});
  EXPECT_EQ(bench.chip.reg(0xFE), 0x03);
  bench.wake();
  bench.write({0xFE, 0x79});
  EXPECT_EQ(bench.chip.reg(0xFE), 0x03);
}

TEST(Pca9685Model, FullOffWinsOverFullOnAndBothOverTheCounts) {
  Pca9685ModelBench bench;
  bench.wake();
  bench.write({0x06, 0x00, 0x00, 0x00, 0x08});
  EXPECT_EQ(bench.chip.duty(0), 2048);
  bench.write({0x07, 0x10});
  EXPECT_EQ(bench.chip.duty(0), 4096);
  bench.write({0x09, 0x18});
  EXPECT_EQ(bench.chip.duty(0), 0);
}

TEST(Pca9685Model, APulseMayBeginAnywhereInTheCycle) {
  Pca9685ModelBench bench;
  bench.wake();
  bench.write({0x06, 0x99, 0x01, 0xCC, 0x04});  // data sheet, example 1: 409 to 1228
  EXPECT_EQ(bench.chip.duty(0), 819);
  bench.write({0x06, 0xFF, 0x0D, 0x99, 0x01});
  EXPECT_EQ(bench.chip.duty(0), 4096 - 0xDFF + 0x199);
}

TEST(Pca9685Model, OutputsChangeOnStopOrOnAcknowledge) {
  Pca9685ModelBench bench;
  bench.wake();
  bench.bus.hold_after(5);  // address, register, three bytes
  bench.write({0x06, 0x00, 0x10, 0x00, 0x00});
  EXPECT_EQ(bench.chip.duty(0), 0);
  bench.bus.clear_errors();
  bench.write({0x01, 0x0C});
  bench.bus.hold_after(6);
  bench.write({0x06, 0x00, 0x10, 0x00, 0x00});
  EXPECT_EQ(bench.chip.duty(0), 4096);
}

TEST(Pca9685Model, OutputsAreOffInSleepAndForHalfAMillisecondAfter) {
  Pca9685ModelBench bench;
  bench.write({0x00, 0x31});
  bench.write({0x06, 0x00, 0x10, 0x00, 0x00});
  EXPECT_EQ(bench.chip.duty(0), 0);
  bench.write({0x00, 0x21});
  EXPECT_EQ(bench.chip.duty(0), 0);
  bench.bus.advance(600);
  EXPECT_EQ(bench.chip.duty(0), 4096);
}

TEST(Pca9685Model, ChannelsThatWereRunningWaitForRestart) {
  Pca9685ModelBench bench;
  bench.wake();
  bench.write({0x06, 0x00, 0x10, 0x00, 0x00});
  bench.write({0x00, 0x31});
  EXPECT_EQ(bench.read(0x00, 1), Bytes{0xB1});
  bench.write({0x00, 0x21});
  bench.write({0x00, 0xA1});  // too early: the oscillator needs 500 us
  EXPECT_EQ(bench.read(0x00, 1), Bytes{0xA1});
  bench.bus.advance(600);
  EXPECT_EQ(bench.chip.duty(0), 0);
  bench.write({0x00, 0xA1});
  EXPECT_EQ(bench.read(0x00, 1), Bytes{0x21});
  EXPECT_EQ(bench.chip.duty(0), 4096);
}

TEST(Pca9685Model, AnOrderlyShutdownLeavesNothingToRestart) {
  Pca9685ModelBench bench;
  bench.wake();
  bench.write({0x06, 0x00, 0x10, 0x00, 0x00});
  bench.write({0xFD, 0x10});
  bench.write({0x00, 0x31});
  EXPECT_EQ(bench.read(0x00, 1), Bytes{0x31});
}

TEST(Pca9685Model, AnswersAllCallAndSubAddressesAsConfigured) {
  Pca9685ModelBench bench;
  EXPECT_EQ(bench.write({0xFD, 0x10}, 0x70), I2cResult::ok);
  EXPECT_EQ(bench.write({0xFD, 0x10}, 0x71), I2cResult::no_acknowledge);
  std::uint8_t byte = 0;
  EXPECT_EQ(bench.bus.write_read(0x70, nullptr, 0, &byte, 1), I2cResult::ok);
  EXPECT_EQ(bench.bus.write_read(0x71, nullptr, 0, &byte, 1), I2cResult::no_acknowledge);
  bench.write({0x00, 0x18});  // SUB1 on, ALLCALL off
  EXPECT_EQ(bench.write({0xFD, 0x10}, 0x70), I2cResult::no_acknowledge);
  EXPECT_EQ(bench.write({0xFD, 0x10}, 0x71), I2cResult::ok);
  bench.write({0x00, 0x14});
  EXPECT_EQ(bench.write({0xFD, 0x10}, 0x72), I2cResult::ok);
  bench.write({0x00, 0x12});
  EXPECT_EQ(bench.write({0xFD, 0x10}, 0x74), I2cResult::ok);
}

TEST(Pca9685Model, ASoftwareResetIsOneByteToTheGeneralCall) {
  Pca9685ModelBench bench;
  bench.write({0xFE, 0x79});
  EXPECT_EQ(bench.write({0x07}, 0), I2cResult::no_acknowledge);
  EXPECT_EQ(bench.write({0x06, 0x06}, 0), I2cResult::no_acknowledge);
  EXPECT_EQ(bench.chip.reg(0xFE), 0x79);
  EXPECT_EQ(bench.write({0x06}, 0), I2cResult::ok);
  EXPECT_EQ(bench.chip.reg(0xFE), 0x1E);
}

TEST(Pca9685Model, InvertedOutputsAreOnWhenTheyAreTurnedOff) {
  Pca9685ModelBench bench;
  bench.wake();
  bench.chip.disturb(0x01, 0x10);
  bench.write({0xFD, 0x10}, 0x70);
  EXPECT_TRUE(bench.chip.high(0));
  bench.write({0x01, 0x04});
  EXPECT_EQ(bench.chip.duty(0), 0);
}

TEST(Pca9685Model, KeepsItsOutputsWithoutAClockUntilAReset) {
  Pca9685ModelBench bench;
  bench.wake();
  bench.write({0x06, 0x00, 0x00, 0x34, 0x02});
  bench.chip.disturb(0x00, 0x40);
  bench.write({0xFD, 0x10}, 0x70);
  EXPECT_TRUE(bench.chip.high(0)) << "the clock may have stopped while a pulse was high";
  EXPECT_EQ(bench.chip.duty(1), 0);
  bench.write({0x00, 0x31});
  EXPECT_EQ(bench.read(0x00, 1), Bytes{0x71}) << "EXTCLK cannot be cleared by writing";
  bench.write({0x06}, 0);
  EXPECT_EQ(bench.read(0x00, 1), Bytes{0x11});
  EXPECT_EQ(bench.chip.duty(0), 0);
}

TEST(Pca9685Model, AllLedRegistersWriteAllAndReadZero) {
  Pca9685ModelBench bench;
  bench.wake();
  bench.write({0xFA, 0x00, 0x00, 0x34, 0x02});
  for (int i = 0; i < Pca9685Model::channels; ++i) EXPECT_EQ(bench.chip.duty(i), 0x234);
  EXPECT_EQ(bench.read(0xFA, 4), (Bytes{0, 0, 0, 0}));
}

}  // namespace
}  // namespace r4::sim
