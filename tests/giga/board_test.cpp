// SPDX-License-Identifier: GPL-3.0-or-later
// The whole firmware on a fake Giga: its power-up, its link over CAN, its report and its light.
#include <algorithm>

#include "bench.hpp"

namespace r4::test {
namespace {

TEST(GigaPowerUp, SwitchesEveryOutputOffBeforeAnythingElse) {
  GigaBench bench;
  const auto& log = bench.giga.i2c.log;
  bench.boot();
  ASSERT_GE(log.size(), 6U);
  EXPECT_EQ(log[0][0], 0x70 << 1 | 1) << "first a read: are there PWM chips";
  EXPECT_EQ(log[1], (std::vector<std::uint8_t>{0, 0x06})) << "then the reset of all PWM chips";
  EXPECT_EQ(log[2], (std::vector<std::uint8_t>{0x70 << 1, 0xFD, 0x10})) << "then all off";
  const auto first_set_up = std::find_if(log.begin(), log.end(), [](const auto& transfer) {
    return transfer.size() > 1 && (transfer[0] >> 1 == 0x40) && transfer[1] == 0xFE;
  });
  const auto relays_off = std::find_if(log.begin(), log.end(), [](const auto& transfer) {
    return transfer[0] >> 1 == 0x20 && transfer.size() > 1 && transfer[1] == 0x14;
  });
  EXPECT_LT(relays_off - log.begin(), first_set_up - log.begin());
  EXPECT_TRUE(bench.giga.watchdog_runs);
  EXPECT_TRUE(bench.pins().is_safe());
}

TEST(GigaPowerUp, StepAndTriggerPinsAreLow) {
  GigaBench bench;
  bench.boot();
  const Wiring wiring = plan_wiring();
  for (int i = 1; i <= stepper_channels; ++i) {
    const giga::Pin pin = giga::pin_of(wiring.at(SignalKind::step, i));
    EXPECT_FALSE(bench.giga.pin(pin.port, pin.number));
  }
  for (int i = 1; i <= ultrasonic_channels; ++i) {
    const giga::Pin pin = giga::pin_of(wiring.at(SignalKind::trigger, i));
    EXPECT_EQ(r4_fake_gpio[pin.port - 'A'].MODER.value >> (2 * pin.number) & 3U, 1U);
  }
}

TEST(GigaLink, ASilentHostMakesEverythingSafeInTheTimerInterrupt) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  const std::uint64_t fed_ms = bench.giga.now_ms();
  while (!bench.pins().is_safe() && bench.giga.now_ms() < fed_ms + 2000) bench.turn();
  EXPECT_LE(bench.giga.now_ms() - fed_ms, 1000U + 20U);
}

class GigaCanForm : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(PackedAndPlain, GigaCanForm, testing::Bool());

TEST_P(GigaCanForm, DrivesAMotorAndReportsInTheHostsForm) {
  GigaBench bench;
  bench.can_node.use_packed_form(GetParam());
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.can());
  bench.can_datagrams.clear();
  const std::uint32_t unpacked = bench.can_node.counters().unpacked;
  bench.run_ms(50);
  ASSERT_FALSE(bench.can_datagrams.empty());
  EXPECT_NE(bench.can_datagrams.back().find("OSMC1:358,1;"), std::string::npos);
  EXPECT_EQ(bench.can_node.counters().unpacked - unpacked,
            GetParam() ? bench.can_datagrams.size() : 0);
}

TEST(GigaCan, LeavesBusOffByItself) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.can());
  bench.giga.can.go_bus_off();
  bench.run_ms(5);
  EXPECT_EQ(bench.reason(), SafeReason::link);
  EXPECT_TRUE(bench.pins().is_safe());
  bench.giga.can.sent.clear();
  bench.run_ms(700);
  ASSERT_FALSE(bench.giga.can.sent.empty());
  EXPECT_LT(bench.giga.can.sent.front().data[0], 0x20)
      << "not the rest of the interrupted datagram";
  bench.can_datagrams.clear();
  bench.run_ms(600, host, bench.can());
  EXPECT_TRUE(bench.active());
  EXPECT_FALSE(bench.can_datagrams.empty());
}

TEST(GigaCan, ReportsAtOnceThatItWentSafe) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.can());
  bench.giga.set_pin('I', 15, false);
  bench.run_ms(20);
  ASSERT_FALSE(bench.can_raw.empty());
  EXPECT_EQ(bench.can_raw.back().id, went_safe_id(1));
  EXPECT_EQ(bench.can_raw.back().data[0], 3) << "the handle";
}

TEST(GigaStop, ANumberedStopFrameIsObeyed) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  CanFrame frame{};
  frame.extended = true;
  frame.id = numbered_stop_id(200000);
  ASSERT_TRUE(bench.giga.can.deliver(frame));
  bench.run_ms(3);
  EXPECT_EQ(bench.reason(), SafeReason::stop);
  EXPECT_TRUE(bench.pins().is_safe());
}

TEST(GigaReport, MatchesFigure3OfThePaper) {
  GigaBench bench;
  ASSERT_TRUE(bench.boot_in_network());
  bench.run_ms(20);
  std::vector<std::string> lines = bench.report();
  lines.erase(std::remove_if(lines.begin(), lines.end(),
                             [](const std::string& line) { return line.rfind("H:", 0) == 0; }),
              lines.end());
  const std::vector<std::string> expected = {
      "R4 Test!",
      "Heartbeat Frequency Hz   : 2",
      "TimedheartBeatlimiter    : 50",
      "HeartbeatInterval_ms     : 500",
      "heartbeatIntervalMax     : 1000",
      "Datagram  Frequency Hz   : 100",
      "datagramInteruptlimiter  : 10",
      "datagramInterval_ms      : 10",
      "Scanning i2c Bus...",
      "i2c device found at address 0x20",
      "i2c device found at address 0x40",
      "i2c device found at address 0x41",
      "i2c device found at address 0x42",
      "i2c device found at address 0x61",
      "i2c device found at address 0x70",
      "Scan Complete",
      "[TISR] Timer Input Freq (Hz) = 240000000",
      "[TISR] Frequency =1000.00, _count = 1000",
      "Started ITimer0 OK",
      "Initializing Giga WiFi UDP Client",
      "192.168.0.162",
      "Connected to Wifi: lab : WL_CONNECTED",
      "Starting Wifi UDP - 0 means failed: 1, port 2018",
      "CAN: 1000 kbit/s, node 1, active, errors sent 0, received 0, bus-offs 0",
      "Settings: kept in the key-value store",
      "Wiring: given by its owner",
      "PCA9685 0x40 (OSMC): ok",
      "PCA9685 0x41 (DHB12): ok",
      "PCA9685 0x42 (servos): ok",
      "MCP23017 0x20 (relays, BLDC direction and brake): ok",
      "MCP4728 0x61 (BLDC speed): ok",
      "Deadlines missed: 0",
      "Interrupt stacks: the core's 264 of 1024, ours 0 of 4096",
      "Last boot ended by: power or reset",
  };
  EXPECT_EQ(lines, expected);
}

TEST(GigaLight, ShowsTheState) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.run_ms(200, host, bench.usb());
  EXPECT_FALSE(bench.giga.pin('J', 13)) << "green: low is on";
  EXPECT_TRUE(bench.giga.pin('I', 12));
  bench.usb()(with_crc("E:STOP;"));
  bench.run_ms(5);
  EXPECT_FALSE(bench.giga.pin('I', 12)) << "red";
  EXPECT_TRUE(bench.giga.pin('J', 13));
}

}  // namespace
}  // namespace r4::test
