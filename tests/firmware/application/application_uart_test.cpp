// SPDX-License-Identifier: GPL-3.0-or-later
// The user's UARTs, DAC and spare inputs through the protocol.
#include <gtest/gtest.h>

#include <string>

#include "firmware/ports/sim/devices/user_devices.hpp"
#include "tests/firmware/board_fixture.hpp"

namespace r4 {
namespace {

using sim::UartPeer;
using test::another_session;
using test::Heard;
using test::our_session;
using test::TestBoard;
using test::TestHost;

class ApplicationUarts : public testing::Test {
 protected:
  ApplicationUarts() { host.connect(); }
  void pass(std::uint32_t ms, bool echoes = true) {
    for (; ms != 0; --ms) {
      devices.pass_millisecond();
      ++board.now_ms;
      if (echoes && board.now_ms % 100 == 0) host.echo();
      board.application->poll(board.now_ms);
    }
  }
  State newest_state() {
    const auto heard = board.take(MessageKind::state);
    return heard.empty() ? State() : state_of(heard.back());
  }
  std::string refused(const std::string& command) {
    const std::size_t before = board.log.refused.size();
    const std::string number = std::to_string(host.command(command)) + " ";
    if (board.log.refused.size() == before) return "";
    return board.log.refused.back().substr(number.size());
  }

  sim::UserDevices devices;
  firmware::UserUart uarts[uart_channels] = {firmware::UserUart(devices.uarts[0]),
                                             firmware::UserUart(devices.uarts[1])};
  TestBoard board{Settings(), 1, 500'000, nullptr, &uarts};
  TestHost host{board, our_session};
};

TEST_F(ApplicationUarts, ASettingTurnsAUartOnAndStatesReportItsBytes) {
  host.command("C:uart1,115200:8N1");
  host.command("F:UART1,UART2");
  pass(500);
  const State state = newest_state();
  ASSERT_TRUE(state.present.has(StateField::uart1));
  EXPECT_GT(state.raw.uart[0].position, 1000U);
  EXPECT_EQ(state.raw.uart[0].lost, 0U);
  EXPECT_EQ(state.raw.uart[1].position, 0U) << "this UART is off";
  host.command("C:uart1,off");
  EXPECT_FALSE(devices.uarts[0].mode().on());
  EXPECT_EQ(refused("C:uart3,off"), "UNKNOWN");
  EXPECT_EQ(refused("C:uart1,115200"), "FORMAT");
  EXPECT_EQ(refused("C:uart1,115200:7N1"), "FORMAT");
  EXPECT_EQ(refused("C:uart1,115200:8N3"), "FORMAT");
  EXPECT_EQ(refused("C:uart1,1199:8N1"), "RANGE");
  EXPECT_EQ(refused("C:uart1,460801:8N1"), "RANGE");
}

TEST_F(ApplicationUarts, ReportsEachByteAtItsPosition) {
  host.command("C:uart1,115200:8N1");
  host.command("F:UART1");
  pass(1);
  board.take();
  pass(2000);
  std::uint32_t next = 0;
  for (const Heard& heard : board.take(MessageKind::state)) {
    const UartBytes bytes = state_of(heard).raw.uart[0];
    EXPECT_LE(bytes.position, next);
    next = bytes.position + bytes.data.size;
  }
  EXPECT_GT(next, 5000U);
}

TEST_F(ApplicationUarts, SkipsBytesThatCameWhileTheLinkWasLost) {
  host.command("C:uart1,115200:8N1");
  host.command("F:UART1");
  pass(500);
  const std::uint32_t before = newest_state().raw.uart[0].position;
  pass(5000, false);
  board.take();
  host.echo();
  pass(100);
  const auto heard = board.take(MessageKind::state);
  ASSERT_FALSE(heard.empty());
  const UartBytes first = state_of(heard.front()).raw.uart[0];
  EXPECT_GT(first.position, before + firmware::UserUart::backlog)
      << "a gap, as long as the bytes that were lost";
  EXPECT_LT(first.data.size, 40) << "the bytes since the link came back";
}

TEST_F(ApplicationUarts, AWriteIsAnOutput) {
  devices.uarts[0].connect(UartPeer::loop);
  EXPECT_EQ(refused("X:UART,1,x41"), "CHANNEL") << "the UART is off";
  host.command("C:uart1,9600:8N1");
  EXPECT_EQ(refused("X:UART,1,x41"), "");
  pass(20);
  EXPECT_EQ(devices.uarts[0].sent(), 1U);
  EXPECT_EQ(refused("X:UART,3,x41"), "CHANNEL");
  EXPECT_EQ(refused("X:UART,1,x"), "RANGE");
  EXPECT_EQ(refused("X:UART,1,x4"), "FORMAT");
  EXPECT_EQ(refused("X:UART,1,x" + std::string(98, '0')), "RANGE");
  const std::string longest = "X:UART,1,x" + std::string(96, '4');
  const std::uint32_t number = host.command(longest);
  host.resend(longest, number);
  EXPECT_EQ(board.log.refused.back(), std::to_string(number) + " DUPLICATE");
  EXPECT_EQ(refused(longest), "");
  EXPECT_EQ(refused(longest), "FULL");
  pass(10);
  host.command("E:STOP");
  const std::uint32_t sent = devices.uarts[0].sent();
  EXPECT_EQ(refused("X:UART,1,x41"), "SAFE");
  pass(200);
  EXPECT_EQ(devices.uarts[0].sent(), sent) << "waiting bytes are dropped";
}

TEST_F(ApplicationUarts, ADacIsAnOutputThatIsZeroInTheSafeState) {
  host.command("F:DAC1,DAC2");
  EXPECT_EQ(refused("X:DAC,1,1650"), "");
  EXPECT_EQ(refused("X:DAC,2,3300"), "");
  EXPECT_EQ(board.outputs().dac_mv[0], 1650);
  pass(20);
  EXPECT_EQ(newest_state().raw.dac_mv[1], 3300);
  EXPECT_EQ(refused("X:DAC,3,1"), "CHANNEL");
  EXPECT_EQ(refused("X:DAC,1,3301"), "RANGE");
  EXPECT_EQ(refused("X:DAC,1,-1"), "RANGE");
  EXPECT_EQ(refused("X:DAC,1"), "FORMAT");
  host.command("E:STOP");
  EXPECT_EQ(board.outputs().dac_mv[0], 0);
  EXPECT_EQ(refused("X:DAC,1,1"), "SAFE");
  host.clear();
  EXPECT_EQ(board.outputs().dac_mv[1], 0) << "the voltage is not restored";
  host.command("X:DAC,1,1000");
  pass(1001, false);
  EXPECT_EQ(board.outputs().dac_mv[0], 0) << "the host is silent";
}

TEST_F(ApplicationUarts, TheStateHasOneBitPerSpareInput) {
  host.command("F:GPIO");
  board.hal.inputs.gpio = 0x85;
  pass(20);
  const State state = newest_state();
  EXPECT_EQ(state.gpio, 0x85);
  EXPECT_TRUE(state.input(8));
  EXPECT_FALSE(state.input(2));
  EXPECT_FALSE(state.input(9));
}

TEST_F(ApplicationUarts, TheIdentityListsUartAndDac) {
  host.command("Q:ID");
  bool found = false;
  for (const Heard& heard : board.take()) {
    found = found || heard.bytes.find("+uart+dac") != std::string::npos;
  }
  EXPECT_TRUE(found);
}

TEST(ApplicationWithoutUarts, RefusesAUartWriteAsUnknown) {
  TestBoard board;
  TestHost host(board, our_session);
  host.connect();
  const std::uint32_t number = host.command("X:UART,1,x41");
  EXPECT_EQ(board.log.refused.back(), std::to_string(number) + " UNKNOWN");
}

}  // namespace
}  // namespace r4
