// SPDX-License-Identifier: GPL-3.0-or-later
// The user's I2C bus through the protocol: commands, the fields of a state, the safe state, and the
// end of the session.
#include <gtest/gtest.h>

#include <string>

#include "firmware/ports/sim/devices/user_devices.hpp"
#include "tests/firmware/board_fixture.hpp"

namespace r4 {
namespace {

using test::another_session;
using test::Heard;
using test::our_session;
using test::TestBoard;
using test::TestHost;

class ApplicationDevices : public testing::Test {
 protected:
  ApplicationDevices() { host.connect(); }

  // Advances the time; if `echoes`, with heartbeats that echo the board's time.
  void pass(std::uint32_t ms, bool echoes = true) {
    for (; ms != 0; --ms) {
      devices.bus.advance(1000);
      ++board.now_ms;
      if (echoes && board.now_ms % 100 == 0) host.echo();
      board.application->poll(board.now_ms);
    }
  }
  State newest_state() {
    const auto heard = board.take(MessageKind::state);
    return heard.empty() ? State() : state_of(heard.back());
  }

  sim::UserDevices devices;
  firmware::UserI2c i2c{devices.bus};
  TestBoard board{Settings(), 1, 500'000, &i2c};
  TestHost host{board, our_session};
};

TEST_F(ApplicationDevices, AnswersWithTheCommandNumberForOneSecond) {
  const std::uint32_t number = host.command("X:READ,0x68,x75,1");
  pass(20);
  State state = newest_state();
  ASSERT_TRUE(state.present.has(StateField::i2cx)) << "the field is sent without a selection";
  EXPECT_EQ(state.i2c_answer.pnum, number);
  EXPECT_EQ(state.i2c_answer.outcome, I2cOutcome::done);
  ASSERT_EQ(state.i2c_answer.data.size, 1);
  EXPECT_EQ(state.i2c_answer.data.bytes[0], 0x68);
  pass(1020);
  EXPECT_FALSE(newest_state().present.has(StateField::i2cx));
  host.command("F:I2CX,I2CBUS");
  pass(20);
  state = newest_state();
  EXPECT_EQ(state.i2c_answer.pnum, number) << "a selected field stays";
  EXPECT_TRUE(state.present.has(StateField::i2cbus));
}

TEST_F(ApplicationDevices, ADeviceCommandIsExecutedOnce) {
  const std::uint32_t number = host.command("X:WRITE,0x68,x6b00");
  pass(20);
  const std::uint32_t transfers = devices.bus.transfers();
  host.resend("X:WRITE,0x68,x6b00", number);
  EXPECT_EQ(board.log.refused.back(), std::to_string(number) + " DUPLICATE");
  pass(20);
  EXPECT_EQ(devices.bus.transfers(), transfers);
}

TEST_F(ApplicationDevices, RefusesADeviceCommandWhileOneIsInProgress) {
  host.command("X:SCAN");
  const std::uint32_t second = host.command("X:READ,0x68,x75,1");
  EXPECT_EQ(board.log.refused.back(), std::to_string(second) + " FULL");
}

TEST_F(ApplicationDevices, TheSafeStateRefusesOnlyWrites) {
  host.command("E:STOP");
  const std::uint32_t write = host.command("X:WRITE,0x68,x6b00");
  EXPECT_EQ(board.log.refused.back(), std::to_string(write) + " SAFE");
  const std::uint32_t read = host.command("X:READ,0x68,x6b,1");
  pass(20);
  const State state = newest_state();
  EXPECT_EQ(state.i2c_answer.pnum, read);
  EXPECT_EQ(state.i2c_answer.data.bytes[0], 0x40) << "the device still sleeps";
  host.command("X:POLL,0x68,x75,1,10,1");
  host.command("X:SCAN");
  EXPECT_EQ(board.log.refused.size(), 1U);
}

TEST_F(ApplicationDevices, AStopDropsAWaitingWrite) {
  host.command("X:POLL,0x68,x3b,14,5,1");
  pass(1);  // the reading is on the wire
  const std::uint32_t write = host.command("X:WRITE,0x68,x6b00");
  host.command("E:STOP");
  pass(20);
  State state = newest_state();
  EXPECT_EQ(state.i2c_answer.pnum, write);
  EXPECT_EQ(state.i2c_answer.outcome, I2cOutcome::cancelled);
  EXPECT_EQ(devices.mpu6050.start(0x68, true), true);
  host.command("X:READ,0x68,x6b,1");
  pass(20);
  EXPECT_EQ(newest_state().i2c_answer.data.bytes[0], 0x40) << "the write was not carried out";
}

TEST_F(ApplicationDevices, OnlyReadingsFromSettingsOutlastTheSession) {
  host.command("C:i2c2,0x40:x02:2:20");
  host.command("X:POLL,0x68,x75,1,20,1");
  host.command("X:OFF,2");
  host.command("F:I2C1,I2C2");
  pass(50);
  State state = newest_state();
  EXPECT_EQ(state.raw.i2c[0].data.size, 1);
  EXPECT_EQ(state.raw.i2c[1].data.size, 0) << "this session turned the reading off";

  pass(1200, false);  // the host is silent
  ASSERT_EQ(board.reason(), SafeReason::link);
  TestHost next(board, another_session, Source{0, 9});
  next.connect();
  next.command("F:I2C1,I2C2");
  pass(50, false);
  state = newest_state();
  EXPECT_EQ(state.raw.i2c[0].data.size, 0) << "a reading of one session is not sent to another";
  EXPECT_EQ(state.raw.i2c[0].t_ms, 0U);
  EXPECT_EQ(state.raw.i2c[1].data.size, 2);
  EXPECT_NE(state.raw.i2c[1].t_ms, 0U);
}

TEST_F(ApplicationDevices, EveryStateHasTheReadingAndItsTime) {
  host.command("F:I2C1");
  host.command("X:POLL,0x68,x75,1,50,1");
  board.take();
  pass(100);
  const auto states = board.take(MessageKind::state);
  ASSERT_EQ(states.size(), 10U);
  for (const Heard& heard : states) {
    EXPECT_LE(heard.t_ms - state_of(heard).raw.i2c[0].t_ms, 60U);
  }
}

TEST_F(ApplicationDevices, TheUsersBusHasNoChipsOfTheBoard) {
  host.command("X:READ,0x41,x00,1");  // a PCA9685 of the board
  pass(20);
  EXPECT_EQ(newest_state().i2c_answer.outcome, I2cOutcome::no_acknowledge);
}

TEST(ApplicationWithoutDevices, RefusesDeviceCommandsAsUnknown) {
  TestBoard board;
  TestHost host(board, our_session);
  host.connect();
  const std::uint32_t number = host.command("X:SCAN");
  EXPECT_EQ(board.log.refused.back(), std::to_string(number) + " UNKNOWN");
}

}  // namespace
}  // namespace r4
