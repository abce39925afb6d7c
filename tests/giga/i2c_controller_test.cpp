// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/ports/giga/chip/i2c_controller.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <optional>

#include "fake_giga.hpp"
#include "firmware/ports/giga/buses.hpp"
#include "firmware/ports/giga/chip/board_clock.hpp"
#include "firmware/ports/giga/pins.hpp"
#include "tests/giga/core/registers.hpp"

namespace r4::test {
namespace {

using firmware::I2cResult;
using Bytes = std::vector<std::uint8_t>;

class Bus {
 public:
  Bus() {
    giga::start_ports();
    bus.start(120000000);
  }
  I2cResult write(std::uint8_t address, const Bytes& bytes) {
    began_us_ = now_us();
    const I2cResult result = bus.write(address, bytes.data(), bytes.size());
    took_us = now_us() - began_us_;
    return result;
  }
  // Reads MODE1 of 0x40. After power-up the chip repeats the register for each byte.
  I2cResult read(Bytes& in) {
    const std::uint8_t mode1 = 0x00;
    began_us_ = now_us();
    const I2cResult result = bus.write_read(0x40, &mode1, 1, in.data(), in.size());
    took_us = now_us() - began_us_;
    return result;
  }
  std::uint64_t now_us() const { return chip.now_ns() / 1000; }
  // Writes four bytes to 0x40, with one interrupt after `at_us`. Empty if the write ended before
  // the interrupt.
  std::optional<I2cResult> write_interrupted(std::uint64_t at_us,
                                             const std::function<void()>& interrupt) {
    return interrupted(at_us, interrupt, [&] { return write(0x40, {0x06, 0x00, 0x10, 0x00}); });
  }
  std::optional<I2cResult> interrupted(std::uint64_t at_us, const std::function<void()>& interrupt,
                                       const std::function<I2cResult()>& transfer) {
    bool interrupted = false;
    chip.ticker.period_ns = ~0ULL / 4;
    chip.ticker.next_ns = chip.now_ns() + at_us * 1000;
    chip.ticker.action = [&] {
      interrupted = true;
      interrupt();
    };
    const I2cResult result = transfer();
    return interrupted ? std::optional(result) : std::nullopt;
  }
  // All outputs of the chips off: the interrupts of the tests write this.
  I2cResult write_off() {
    const std::uint8_t off[] = {0xFD, 0x10};
    return bus.write(0x70, off, 2);
  }

  fake::Giga chip;
  giga::I2cController bus{giga::parts_of_bus(0), &giga::BoardClock::now_us};
  std::uint64_t took_us = 0;

 private:
  std::uint64_t began_us_ = 0;
};

TEST(I2cTiming, KeepsTheLimitsOfFastModeForEveryClock) {
  for (std::uint32_t mhz = 4; mhz <= 250; ++mhz) {
    const std::uint32_t timing = giga::i2c_timing(mhz * 1000000);
    const double tick_ns = 1000.0 * ((timing >> 28) + 1) / mhz;
    const double low = tick_ns * ((timing & 0xFF) + 1);
    const double high = tick_ns * ((timing >> 8 & 0xFF) + 1);
    const double hold = tick_ns * (timing >> 16 & 0xF);
    const double setup = tick_ns * ((timing >> 20 & 0xF) + 1);
    EXPECT_GE(low, 1300) << mhz;  // UM10204 table 10
    EXPECT_GE(high, 600) << mhz;
    EXPECT_GE(setup, 100 + 300) << mhz << ": with the rise time";
    EXPECT_LE(hold, 900) << mhz;
    EXPECT_GE(low + high, 2500) << mhz << ": 400 kHz";
    EXPECT_LE(low + high, 3100) << mhz << ": not needlessly slow";
    EXPECT_EQ(timing & 0x0F000000, 0U) << "reserved";
  }
}

TEST(I2cController, PutsBytesOnTheWire) {
  Bus bus;
  EXPECT_EQ(bus.write(0x40, {0x06, 0x00, 0x10}), I2cResult::ok);
  EXPECT_EQ(bus.chip.i2c.log, (std::vector<Bytes>{{0x80, 0x06, 0x00, 0x10}}));
  EXPECT_LE(bus.took_us, firmware::i2c_wire_us(4) + 20);
}

TEST(I2cController, ReadsAfterARepeatedStart) {
  Bus bus;
  const std::uint8_t mode1 = 0x00;
  Bytes in(2);
  EXPECT_EQ(bus.bus.write_read(0x40, &mode1, 1, in.data(), 2), I2cResult::ok);
  EXPECT_EQ(in[0], 0x11) << "MODE1 after power-up";
  EXPECT_EQ(bus.chip.i2c.log, (std::vector<Bytes>{{0x80, 0x00}, {0x81}}));
}

TEST(I2cController, ReportsThatNoChipAnswers) {
  Bus bus;
  EXPECT_EQ(bus.write(0x55, {1, 2, 3}), I2cResult::no_acknowledge);
  EXPECT_LE(bus.took_us, 60U);
  Bytes in(1);
  EXPECT_EQ(bus.bus.write_read(0x55, nullptr, 0, in.data(), 1), I2cResult::no_acknowledge);
  EXPECT_EQ(bus.write(0x40, {0x00}), I2cResult::ok) << "the bus still works";
}

TEST(I2cController, ProbesAnAddressWithoutSendingBytes) {
  Bus bus;
  EXPECT_EQ(bus.write(0x61, {}), I2cResult::ok);
  EXPECT_EQ(bus.write(0x62, {}), I2cResult::no_acknowledge);
}

TEST(I2cController, RefusesATransferOfMoreThan255Bytes) {
  Bus bus;
  EXPECT_EQ(bus.write(0x40, Bytes(256)), I2cResult::no_acknowledge);
  EXPECT_TRUE(bus.chip.i2c.log.empty());
}

TEST(I2cController, ARefusedTransferLeavesNoByteForTheNext) {
  for (int after = 0; after < 4; ++after) {
    Bus bus;
    bus.chip.i2c.refuse_after(after);
    EXPECT_EQ(bus.write(0x40, {0x06, 1, 2, 3}), I2cResult::no_acknowledge) << after;
    bus.chip.i2c.log.clear();
    EXPECT_EQ(bus.write(0x70, {0xFD, 0x10}), I2cResult::ok) << after;
    EXPECT_EQ(bus.chip.i2c.log, (std::vector<Bytes>{{0xE0, 0xFD, 0x10}})) << after;
  }
}

TEST(I2cController, ARecoveryOfAFreeBusSendsOnlyAStopCondition) {
  Bus bus;
  const int before = bus.chip.rises(giga::i2c_scl_pins[0].port, giga::i2c_scl_pins[0].number);
  EXPECT_TRUE(bus.bus.recover());
  EXPECT_LE(bus.chip.rises(giga::i2c_scl_pins[0].port, giga::i2c_scl_pins[0].number) - before, 2)
      << "SCL is released, then STOP";
}

TEST(I2cController, AHeldLineTimesOutWithinTheLimit) {
  Bus bus;
  bus.chip.i2c.hold_sda(1000);
  for (const std::size_t size : {0U, 1U, 5U, 65U}) {
    EXPECT_EQ(bus.write(0x40, Bytes(size)), I2cResult::timeout);
    EXPECT_LE(bus.took_us, firmware::i2c_most_us(1 + size)) << size;
  }
}

TEST(I2cController, ALineHeldDuringATransferTimesOutWithinTheLimit) {
  Bus bus;
  for (int after = 0; after < 6; ++after) {
    bus.chip.i2c.hold_after(after, 15);
    EXPECT_EQ(bus.write(0x40, {0x06, 0, 0, 0, 0}), I2cResult::timeout) << after;
    EXPECT_LE(bus.took_us, firmware::i2c_most_us(6)) << after;
    EXPECT_TRUE(bus.bus.recover()) << after;
    EXPECT_EQ(bus.write(0x40, {0x06, 0, 0, 0, 0}), I2cResult::ok) << after;
  }
}

TEST(I2cController, FreesAChipThatWasCutOffWithNineClocks) {
  Bus bus;
  bus.chip.i2c.hold_sda(9);
  EXPECT_TRUE(bus.bus.recover());
  EXPECT_EQ(bus.write(0x40, {0x00}), I2cResult::ok);
  bus.chip.i2c.hold_sda(9);
  EXPECT_EQ(bus.write(0x40, {0x00}), I2cResult::ok) << "freed before the second attempt";
  bus.chip.i2c.hold_sda(40);
  EXPECT_FALSE(bus.bus.recover());
  EXPECT_EQ(bus.write(0x40, {0x00}), I2cResult::timeout);
}

TEST(I2cController, ARecoveryFailsSoonIfTheClockIsHeld) {
  Bus bus;
  bus.chip.i2c.hold_scl(true);
  const std::uint64_t before_us = bus.now_us();
  EXPECT_FALSE(bus.bus.recover());
  EXPECT_LT(bus.now_us() - before_us, 100U);
}

TEST(I2cController, ARecoveryReturnsThePinsToThePeripheral) {
  Bus bus;
  bus.bus.recover();
  EXPECT_EQ(GPIOB->MODER.value >> 22 & 3U, 2U);
  EXPECT_EQ(GPIOH->MODER.value >> 8 & 3U, 2U);
  EXPECT_EQ(GPIOB->OTYPER.value >> 11 & 1U, 1U) << "open drain";
  EXPECT_EQ(GPIOB->AFR[1].value >> 12 & 0xFU, 4U);
  EXPECT_EQ(GPIOH->AFR[0].value >> 16 & 0xFU, 4U);
}

TEST(I2cController, IgnoresAFalseBusError) {
  for (int after = 0; after < 4; ++after) {
    Bus bus;
    bus.chip.i2c.report_bus_error_after(after);
    EXPECT_EQ(bus.write(0x40, {0x06, 0x00, 0x10}), I2cResult::ok) << after;
    EXPECT_EQ(bus.chip.i2c.log, (std::vector<Bytes>{{0x80, 0x06, 0x00, 0x10}})) << after;
    const std::uint8_t mode1 = 0x00;
    Bytes in(2);
    bus.chip.i2c.report_bus_error_after(after);
    EXPECT_EQ(bus.bus.write_read(0x40, &mode1, 1, in.data(), 2), I2cResult::ok) << after;
  }
}

// The third byte on the wire is the address of the read.
TEST(I2cController, AReadWhoseChipLeftTheBusIsRepeated) {
  for (int after = 2; after < 5; ++after) {
    Bus bus;
    Bytes in(2);
    bus.chip.i2c.disturb_after(after);
    EXPECT_EQ(bus.read(in), I2cResult::ok) << after;
    EXPECT_EQ(in, Bytes(2, 0x11)) << after;
    EXPECT_EQ(bus.chip.i2c.log.size(), 4U) << after << ": two attempts";
  }
}

TEST(I2cController, AWriteWhoseChipLeftTheBusIsNotAcknowledged) {
  for (int after = 0; after < 3; ++after) {
    Bus bus;
    bus.chip.i2c.disturb_after(after);
    EXPECT_EQ(bus.write(0x40, {0x06, 0x00}), I2cResult::no_acknowledge) << after;
  }
}

// A chip that is interrupted within a byte holds SDA.
TEST(I2cController, AReadThatLostTheBusIsRepeatedOnAFreeBus) {
  for (int after = 0; after < 5; ++after) {
    Bus bus;
    Bytes in(4);
    bus.chip.i2c.lose_after(after, 1);
    EXPECT_EQ(bus.read(in), I2cResult::ok) << after;
    EXPECT_EQ(in, Bytes(4, 0x11)) << after;
    EXPECT_LE(bus.took_us, firmware::i2c_most_us(7, 2)) << after;
    bus.chip.i2c.lose_after(after, 2);
    EXPECT_EQ(bus.read(in), I2cResult::timeout) << after;
    EXPECT_LE(bus.took_us, firmware::i2c_most_us(7, 2)) << after;
    EXPECT_EQ(bus.read(in), I2cResult::ok) << after;
  }
}

TEST(I2cController, AReadThatTimedOutIsRepeatedOnAFreeBus) {
  for (int after = 0; after < 7; ++after) {
    Bus bus;
    Bytes in(4);
    bus.chip.i2c.hold_after(after, 9);
    EXPECT_EQ(bus.read(in), I2cResult::ok) << after;
    EXPECT_EQ(in, Bytes(4, 0x11)) << after;
    EXPECT_LE(bus.took_us, firmware::i2c_most_us(7, 2)) << after;
  }
}

TEST(I2cController, RepeatsATransferOnceAfterALostArbitration) {
  for (int after = 0; after < 4; ++after) {
    Bus bus;
    bus.chip.i2c.lose_after(after, 1);
    EXPECT_EQ(bus.write(0x40, {0x06, 0x00, 0x10}), I2cResult::ok) << after;
    EXPECT_EQ(bus.chip.i2c.log.back(), (Bytes{0x80, 0x06, 0x00, 0x10})) << after;
    bus.chip.i2c.lose_after(after, 2);
    EXPECT_EQ(bus.write(0x40, {0x06, 0x00, 0x10}), I2cResult::timeout) << after;
    EXPECT_LE(bus.took_us, firmware::i2c_most_us(4)) << after;
    EXPECT_EQ(bus.write(0x40, {0x06, 0x00, 0x10}), I2cResult::ok) << after;
  }
}

// An interrupt at every microsecond of two attempts switches everything off. The second attempt
// must not undo the interrupt's write.
TEST(I2cController, DoesNotRepeatATransferAfterAnInterruptUsedTheBus) {
  for (std::uint64_t at_us = 1;; ++at_us) {
    Bus bus;
    bus.chip.i2c.lose_after(3, 1);
    const auto result = bus.write_interrupted(at_us, [&] {
      EXPECT_EQ(bus.write_off(), I2cResult::ok) << at_us;
      bus.chip.i2c.log.clear();
    });
    if (!result) break;
    if (result == I2cResult::timeout) {
      EXPECT_TRUE(bus.chip.i2c.log.empty()) << at_us << ": nothing was sent afterwards";
    }
  }
}

// The interrupt may also occur while SDA is freed for the second attempt.
TEST(I2cController, AReadThatWasTakenOverIsNotRepeated) {
  int taken_over = 0;
  for (std::uint64_t at_us = 1;; ++at_us) {
    Bus bus;
    Bytes in(4);
    bus.chip.i2c.lose_after(3, 1);
    const auto off = [&] {
      EXPECT_EQ(bus.write_off(), I2cResult::ok) << at_us;
      bus.chip.i2c.log.clear();
    };
    const auto result = bus.interrupted(at_us, off, [&] { return bus.read(in); });
    if (!result) break;
    if (result == I2cResult::timeout) {
      ++taken_over;
      EXPECT_TRUE(bus.chip.i2c.log.empty()) << at_us << ": nothing was sent afterwards";
    }
    EXPECT_EQ(bus.read(in), I2cResult::ok) << at_us;
    EXPECT_EQ(in, Bytes(4, 0x11)) << at_us;
  }
  EXPECT_GT(taken_over, 300);
}

// An interrupt at every microsecond of a transfer recovers the bus and uses it.
TEST(I2cController, ATransferDoesNotContinueAfterAnInterruptUsedTheBus) {
  for (std::uint64_t at_us = 1; at_us < 130; ++at_us) {
    Bus bus;
    const auto result = bus.write_interrupted(at_us, [&] {
      EXPECT_TRUE(bus.bus.recover());
      EXPECT_EQ(bus.write_off(), I2cResult::ok);
      bus.chip.i2c.log.clear();
    });
    if (!result) break;
    EXPECT_EQ(result, I2cResult::timeout) << at_us;
    EXPECT_TRUE(bus.chip.i2c.log.empty()) << at_us << ": nothing was sent afterwards";
    EXPECT_EQ(bus.write(0x42, {0x01, 0x04}), I2cResult::ok) << at_us;
    EXPECT_EQ(bus.chip.i2c.log, (std::vector<Bytes>{{0x84, 0x01, 0x04}})) << at_us;
  }
}

TEST(I2cController, ATransferInAnInterruptTakesOverTheBus) {
  for (std::uint64_t at_us = 1; at_us < 130; ++at_us) {
    Bus bus;
    const auto result = bus.write_interrupted(at_us, [&] {
      bus.chip.i2c.log.clear();
      EXPECT_EQ(bus.write_off(), I2cResult::ok) << at_us;
    });
    if (!result) break;
    if (result == I2cResult::timeout) {
      EXPECT_EQ(bus.chip.i2c.log, (std::vector<Bytes>{{0xE0, 0xFD, 0x10}})) << at_us;
    }
    EXPECT_EQ(bus.write(0x42, {0x01, 0x04}), I2cResult::ok) << at_us;
  }
}

}  // namespace
}  // namespace r4::test
