// SPDX-License-Identifier: GPL-3.0-or-later
// The driver of the user's I2C bus on the model of the bus, in virtual time. The loop turns once a
// millisecond.
#include "firmware/devices/user_i2c.hpp"

#include <gtest/gtest.h>

#include <string>

#include "firmware/ports/sim/devices/user_devices.hpp"

namespace r4::firmware {
namespace {

using sim::UserBusModel;
using sim::UserDevice;

struct LineLog final : UserI2cPort {
  Progress progress() override { return Progress::lost; }
  void begin(const UserTransfer&) override {}
  void release() override { scl = sda = true; }
  void drive(bool scl_high, bool sda_high) override {
    if (scl_high && !scl) ++clocks;
    if (scl_high && !scl && held_clocks > 0) --held_clocks;
    stop_seen = scl && scl_high && !sda && sda_high;
    scl = scl_high;
    sda = sda_high;
  }
  bool scl_is_high() override { return scl; }
  bool sda_is_high() override { return sda && held_clocks == 0; }
  void resume() override { resumed = true; }
  bool scl = true, sda = true, stop_seen = false, resumed = false;
  int clocks = 0;
  int held_clocks = 0;  // remaining clocks for which a device holds SDA
};

class UserBus : public testing::Test {
 protected:
  void pass(std::uint32_t ms) {
    for (; ms != 0; --ms) {
      devices.bus.advance(1000);
      ++now_ms;
      bus.poll(now_ms);
    }
  }
  static I2cPoll reads(std::uint8_t address, std::uint8_t at, std::uint8_t count,
                       std::uint16_t period_ms) {
    I2cPoll poll;
    poll.address = address;
    poll.register_bytes[0] = at;
    poll.register_size = 1;
    poll.count = count;
    poll.period_ms = period_ms;
    return poll;
  }
  // The answer to one transfer: its outcome and its bytes.
  std::string answered(const Command& command, std::uint32_t within_ms = 200) {
    if (!bus.ask(++pnum, command)) return "full";
    for (std::uint32_t ms = 0; ms < within_ms; ++ms) {
      pass(1);
      if (!bus.take_answered()) continue;
      EXPECT_EQ(bus.answer().pnum, pnum);
      std::string text = to_text(bus.answer().outcome);
      for (const std::uint8_t byte : bus.answer().data) text += " " + std::to_string(byte);
      return text;
    }
    return "nothing";
  }

  std::uint32_t now_ms = 0xFFFFFF00U;  // close to the wrap
  std::uint32_t pnum = 0;
  sim::UserDevices devices;
  UserI2c bus{devices.bus};
};

TEST_F(UserBus, ReadsWritesAndWritesThenReads) {
  EXPECT_EQ(answered(Command::i2c_read(0x68, "x75", 1)), "done 104");
  EXPECT_EQ(answered(Command::i2c_write(0x68, "x6b00")), "done");
  EXPECT_EQ(answered(Command::i2c_read(0x68, "x6b", 2)), "done 0 0");
  EXPECT_EQ(answered(Command::i2c_write(0x40, "x05", 2)), "done 0 0");
  EXPECT_EQ(answered(Command::i2c_read(0x40, "x", 2)), "done 0 0") << "the register pointer stays";
  EXPECT_EQ(answered(Command::i2c_read(0x41, "x00", 2)), "no acknowledge");
  EXPECT_EQ(bus.report().errors, 1U);
  EXPECT_EQ(bus.report().recoveries, 0U);
}

TEST_F(UserBus, AcceptsOneTransferAtATime) {
  EXPECT_TRUE(bus.ask(1, Command::i2c_read(0x68, "x75", 1)));
  EXPECT_FALSE(bus.ask(2, Command::i2c_read(0x68, "x75", 1)));
  pass(3);
  EXPECT_EQ(bus.answer().pnum, 1U);
  EXPECT_TRUE(bus.ask(3, Command::i2c_read(0x68, "x75", 1)));
}

TEST_F(UserBus, AScanFindsDevicesDuringReadings) {
  bus.poll_slot(1, reads(0x68, 0x75, 1, 5), now_ms);
  EXPECT_EQ(answered(Command::i2c_scan(), 400), "done 64 104");
  EXPECT_EQ(bus.report().errors, 0U) << "an address without a device is not an error of a scan";
  EXPECT_EQ(bus.reading(1).errors, 0U);
}

TEST_F(UserBus, ReadsEachSlotAtItsRate) {
  devices.mpu6050.feel({0, 0, 1000}, {0, 0, 0}, 2500);
  answered(Command::i2c_write(0x68, "x6b00"));
  const std::uint32_t began = devices.bus.transfers();
  bus.poll_slot(1, reads(0x68, 0x3B, 14, 10), now_ms + 1);
  for (int slot = 2; slot <= 8; ++slot) bus.poll_slot(slot, reads(0x40, 0x02, 2, 50), now_ms + 1);
  const std::uint32_t start = now_ms + 1;
  std::uint32_t newest = start;
  for (int i = 0; i < 1000; ++i) {
    pass(1);
    const std::uint32_t t_ms = bus.reading(1).t_ms;
    if (t_ms == newest || t_ms == 0) continue;
    EXPECT_LE((t_ms - start) % 10, 9U);
    newest = t_ms;
  }
  EXPECT_EQ(bus.reading(1).data.size, 14);
  EXPECT_EQ(bus.reading(1).data.bytes[4], 0x40) << "1 g is 16384";
  EXPECT_EQ(bus.reading(8).data.size, 2);
  EXPECT_LE(now_ms - newest, 12U);
  // 100 readings of slot 1, and 20 of each other slot.
  EXPECT_NEAR(devices.bus.transfers() - began, 100 + 7 * 20, 2);
  EXPECT_EQ(bus.report().errors, 0U);
}

TEST_F(UserBus, ReadingsTakeTurnsOnAnOverloadedBus) {
  for (int slot = 1; slot <= 3; ++slot) bus.poll_slot(slot, reads(0x68, 0x3B, 32, 5), now_ms + 1);
  pass(300);
  for (int slot = 1; slot <= 3; ++slot) {
    EXPECT_EQ(bus.reading(slot).data.size, 32) << slot;
    EXPECT_LE(now_ms - bus.reading(slot).t_ms, 20U) << slot;
  }
}

TEST_F(UserBus, AReadingHasTheTimeOfItsStart) {
  bus.poll_slot(3, reads(0x68, 0x75, 1, 1000), now_ms + 1);
  pass(3);
  EXPECT_EQ(bus.reading(3).t_ms, 0xFFFFFF01U);
}

TEST_F(UserBus, SkipsReadingsMissedDuringAStandstill) {
  bus.poll_slot(1, reads(0x68, 0x75, 1, 10), now_ms);
  pass(5);
  const std::uint32_t before = devices.bus.transfers();
  devices.bus.advance(200'000);
  now_ms += 200;  // the loop did not run
  bus.poll(now_ms);
  pass(9);
  EXPECT_LE(devices.bus.transfers() - before, 2U);
}

TEST_F(UserBus, ADisconnectedDeviceKeepsItsLastReadingAndCountsErrors) {
  bus.poll_slot(1, reads(0x68, 0x75, 1, 10), now_ms + 1);
  pass(5);
  const std::uint32_t t_ms = bus.reading(1).t_ms;
  devices.bus.connect(devices.mpu6050, false);
  pass(100);
  EXPECT_EQ(bus.reading(1).t_ms, t_ms);
  EXPECT_EQ(bus.reading(1).data.bytes[0], 0x68);
  EXPECT_EQ(bus.reading(1).errors, 10U);
  EXPECT_EQ(bus.report().newest, I2cOutcome::no_acknowledge);
  devices.bus.connect(devices.mpu6050, true);
  pass(20);
  EXPECT_NE(bus.reading(1).t_ms, t_ms);
  EXPECT_EQ(bus.report().newest, I2cOutcome::done);
}

TEST_F(UserBus, FreesTheBusFromACutOffDevice) {
  devices.bus.set_fault(UserBusModel::Fault::cut_off);
  EXPECT_EQ(answered(Command::i2c_read(0x68, "x75", 1)), "bus stuck");
  EXPECT_EQ(answered(Command::i2c_read(0x68, "x75", 1)), "done 104");
  EXPECT_EQ(bus.report().recoveries, 1U);
  EXPECT_EQ(bus.report().errors, 1U);
}

TEST_F(UserBus, ClocksUntilSdaIsReleasedAndEndsWithAStopCondition) {
  for (const int held : {0, 1, 4, 9}) {
    LineLog lines;
    lines.held_clocks = held;
    UserI2c driver(lines);
    driver.ask(1, Command::i2c_read(0x68, "x75", 1));
    for (std::uint32_t ms = 1; ms < 50 && !lines.resumed; ++ms) {
      driver.poll(ms);
      driver.poll(ms);  // a faster loop does not clock faster
    }
    EXPECT_EQ(lines.clocks, held + 1) << "the last clock is that of STOP";
    EXPECT_TRUE(lines.stop_seen);
    EXPECT_TRUE(lines.resumed);
  }
}

// Two programs, or two threads of a program, may request transfers.
TEST_F(UserBus, AnAnswerStaysUntilTheNextAnswerIsReady) {
  EXPECT_EQ(answered(Command::i2c_read(0x68, "x75", 1)), "done 104");
  ASSERT_TRUE(bus.ask(9, Command::i2c_scan()));
  pass(40);  // the scan has found a device by this time
  EXPECT_EQ(bus.answer().pnum, 1U);
  EXPECT_EQ(bus.answer().data.size, 1);
  EXPECT_EQ(bus.answer().data.bytes[0], 104);
}

TEST_F(UserBus, ANewSessionGetsNoAnswerOfThePreviousSession) {
  EXPECT_EQ(answered(Command::i2c_read(0x68, "x75", 1)), "done 104");
  bus.drop_all();
  EXPECT_EQ(bus.answer().pnum, 0U);
  EXPECT_EQ(bus.answer().data.size, 0);
}

TEST_F(UserBus, AHeldLineFailsTransfersUntilItIsReleased) {
  for (const UserBusModel::Fault fault :
       {UserBusModel::Fault::held, UserBusModel::Fault::stretched}) {
    bus.poll_slot(1, reads(0x68, 0x75, 1, 50), now_ms + 1);
    pass(20);
    devices.bus.set_fault(fault);
    EXPECT_EQ(answered(Command::i2c_read(0x68, "x75", 1)), "bus stuck");
    pass(100);  // the lines are held by this time
    const std::uint32_t errors = bus.reading(1).errors;
    EXPECT_EQ(answered(Command::i2c_read(0x68, "x75", 1), 30), "bus stuck")
        << "the answer comes soon";
    pass(1000);
    EXPECT_NEAR(bus.reading(1).errors - errors, 17, 8) << "readings that are left out are counted";
    EXPECT_GE(bus.report().recoveries, 8U);
    devices.bus.set_fault(UserBusModel::Fault::none);
    pass(UserI2c::free_after_ms + 60);
    EXPECT_EQ(answered(Command::i2c_read(0x68, "x75", 1)), "done 104");
  }
}

TEST_F(UserBus, NoticesALineHeldDuringATransfer) {
  ASSERT_TRUE(bus.ask(1, Command::i2c_read(0x68, "x3b", 14)));
  bus.poll(++now_ms);
  devices.bus.advance(300);
  devices.bus.set_fault(UserBusModel::Fault::stretched);
  pass(UserI2c::transfer_limit_ms);
  EXPECT_TRUE(bus.take_answered());
  EXPECT_EQ(bus.answer().outcome, I2cOutcome::bus_stuck);
}

TEST_F(UserBus, DropsAWaitingWrite) {
  bus.poll_slot(1, reads(0x68, 0x3B, 14, 5), now_ms + 1);
  pass(1);  // a reading is on the wire
  ASSERT_TRUE(bus.ask(7, Command::i2c_write(0x68, "x6b00")));
  bus.drop_write();
  EXPECT_TRUE(bus.take_answered());
  EXPECT_EQ(bus.answer().pnum, 7U);
  EXPECT_EQ(bus.answer().outcome, I2cOutcome::cancelled);
  pass(50);
  EXPECT_EQ(answered(Command::i2c_read(0x68, "x6b", 1)), "done 64") << "the device still sleeps";
}

TEST_F(UserBus, AReadIsNotDropped) {
  ASSERT_TRUE(bus.ask(7, Command::i2c_read(0x68, "x75", 1)));
  bus.drop_write();
  EXPECT_FALSE(bus.take_answered());
  pass(2);
  EXPECT_EQ(bus.answer().outcome, I2cOutcome::done);
}

TEST_F(UserBus, ADroppedTransferDoesNotAffectTheNextAnswer) {
  ASSERT_TRUE(bus.ask(7, Command::i2c_read(0x68, "x3b", 14)));
  bus.poll(++now_ms);
  bus.drop_all();
  EXPECT_FALSE(bus.take_answered());
  EXPECT_EQ(answered(Command::i2c_read(0x68, "x75", 1)), "done 104");
}

TEST_F(UserBus, ChangingASlotDiscardsItsUnfinishedReading) {
  bus.poll_slot(1, reads(0x68, 0x75, 1, 50), now_ms + 1);
  bus.poll(++now_ms);
  bus.poll_slot(1, I2cPoll(), now_ms);
  pass(100);
  EXPECT_EQ(bus.reading(1).data.size, 0);
  EXPECT_EQ(bus.reading(1).t_ms, 0U);
}

}  // namespace
}  // namespace r4::firmware
