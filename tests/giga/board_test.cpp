// SPDX-License-Identifier: GPL-3.0-or-later
// The whole firmware on a fake Giga: what it does at power-up, over its transports, and when parts of
// it fail.
#include <algorithm>

#include "bench.hpp"
#include "firmware/ports/giga/watchdog.hpp"
#include "tests/giga/core/registers.hpp"

namespace r4::test {
namespace {

bool has_line(const std::vector<std::string>& lines, const std::string& part) {
  return std::any_of(lines.begin(), lines.end(),
                     [&](const std::string& line) { return line.find(part) != std::string::npos; });
}

TEST(GigaPowerUp, SwitchesEveryOutputOffBeforeAnythingElse) {
  GigaBench bench;
  const auto& log = bench.giga.i2c.log;
  bench.boot();
  ASSERT_GE(log.size(), 6U);
  EXPECT_EQ(log[0], (std::vector<std::uint8_t>{0x70 << 1, 0xFD, 0x10})) << "all PWM off, first";
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

TEST(GigaPowerUp, StepAndTriggerPinsStandLow) {
  GigaBench bench;
  bench.boot();
  for (const giga::Pin pin : giga::step_pins) EXPECT_FALSE(bench.giga.pin(pin.port, pin.number));
  for (const giga::Pin pin : giga::trigger_pins) {
    EXPECT_EQ(r4_fake_gpio[pin.port - 'A'].MODER.value >> (2 * pin.number) & 3U, 1U);
  }
}

TEST(GigaUsb, DrivesAMotorAndStreamsTheStateAt100Hz) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  EXPECT_EQ(bench.pins().osmc[0].direction, Direction::forward);
  bench.usb_lines();
  bench.run_ms(1000, host, bench.usb());
  const std::vector<std::string> lines = bench.usb_lines();
  const auto states = std::count_if(lines.begin(), lines.end(), [](const std::string& line) {
    return line.find("OSMC1:358,1;") != std::string::npos;
  });
  EXPECT_NEAR(static_cast<double>(states), 100, 2);
}

TEST(GigaUsb, AHostThatStopsReadingNeverHoldsTheLoop) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  bench.giga.usb_reads = false;
  std::uint64_t longest_us = 0;
  for (int i = 0; i < 3000; ++i) {
    const std::uint64_t before = bench.giga.now_ns();
    bench.system->poll();
    longest_us = std::max(longest_us, (bench.giga.now_ns() - before) / 1000);
    giga::rest();
    if (i % 50 == 0) bench.usb()(host.heartbeat(bench.giga.now_ms()));
  }
  EXPECT_LT(longest_us, 3000U);
  EXPECT_TRUE(bench.active()) << "it still hears";
  bench.giga.usb_reads = true;
  bench.giga.usb_host.clear();
  bench.run_ms(60, host, bench.usb());
  const std::vector<std::string> lines = bench.usb_lines();
  ASSERT_GT(lines.size(), 3U);
  // What had begun ends first; behind it there is nothing from before.
  Datagram datagram;
  const std::string& second = lines[2];
  ASSERT_TRUE(read(Text(second.data(), second.size()), datagram)) << second;
  EXPECT_LT(giga::BoardClock::now_ms() - static_cast<std::uint32_t>(datagram.time_ms()), 100U);
}

TEST(GigaUsb, AnUnpluggedCableIsTheEndOfTheSession) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  bench.giga.usb_open = false;
  bench.run_ms(5);
  EXPECT_EQ(bench.reason(), SafeReason::link);
  EXPECT_TRUE(bench.pins().is_safe());
}

TEST(GigaUsb, AProgramThatOpensThePortHearsThePresentFromItsFirstLineOn) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  bench.giga.usb_reads = false;
  bench.run_ms(300, host, bench.usb());
  bench.giga.usb_open = false;
  bench.run_ms(3000);
  bench.giga.usb_host.clear();
  bench.giga.usb_reads = true;
  bench.giga.usb_open = true;
  bench.run_ms(600);
  const std::vector<std::string> lines = bench.usb_lines();
  ASSERT_FALSE(lines.empty());
  Datagram datagram;
  ASSERT_TRUE(read(Text(lines[0].data(), lines[0].size()), datagram)) << lines[0];
  EXPECT_LE(giga::BoardClock::now_ms() - static_cast<std::uint32_t>(datagram.time_ms()), 600U);
}

TEST(GigaUsb, EndsNoBurstWithAFullPacket) {
  // A host's driver waits for more behind a packet of 64 bytes.
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.run_ms(150, host, bench.usb());
  int multiples = 0;
  std::string fields = "RELAYS";
  for (const char* more : {"", "US1", "US2", "ENC1", "US3", "ENC2", "US4", "ENC3", "ENC4"}) {
    if (more[0] != 0) fields += std::string(",") + more;
    bench.usb()(host.command("F:" + fields));
    bench.run_ms(300, host, bench.usb());
    for (const std::string& line : bench.usb_lines()) {
      if ((line.size() + 2) % giga::UsbPort::packet_size == 0) ++multiples;
    }
  }
  EXPECT_GT(multiples, 0) << "otherwise this proves nothing";
  const auto& packets = bench.giga.usb_sent;
  for (std::size_t i = 0; i + 1 < packets.size(); ++i) {
    if (packets[i].size != giga::UsbPort::packet_size) continue;
    EXPECT_LE(packets[i + 1].at_ms - packets[i].at_ms, 2U);
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

TEST(GigaCan, DrivesAMotorAndTellsItsState) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.can());
  bench.run_ms(50);
  ASSERT_FALSE(bench.can_datagrams.empty());
  EXPECT_NE(bench.can_datagrams.back().find("OSMC1:358,1;"), std::string::npos);
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
  EXPECT_LT(bench.giga.can.sent.front().data[0], 0x20) << "not the rest of what was cut off";
  bench.can_datagrams.clear();
  bench.run_ms(600, host, bench.can());
  EXPECT_TRUE(bench.active());
  EXPECT_FALSE(bench.can_datagrams.empty());
}

TEST(GigaCan, TellsAtOnceThatItWentSafe) {
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

TEST(GigaWiFi, JoinsTheNetworkThatIsSetOverUsbAndAnswersThere) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.run_ms(150, host, bench.usb());
  bench.usb()(host.command("C:network,lab"));
  bench.usb()(host.command("C:password,correct%20horse"));
  ASSERT_TRUE(bench.run_until([&] {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    return bench.giga.wifi_connected && bench.giga.udp_port == 2018;
  }));
  bench.giga.usb_open = false;
  bench.run_ms(1100);
  PlainHost other;
  bench.udp()(other.heartbeat(1));
  ASSERT_TRUE(bench.run_until([&] {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    return std::any_of(bench.giga.udp_out.begin(), bench.giga.udp_out.end(),
                       [](const fake::Datagram& datagram) {
                         return datagram.ip == GigaBench::host_ip && datagram.port == 40000 &&
                                datagram.bytes.find("AIN24:") == 0;
                       });
  }));
}

TEST(GigaWiFi, AThreadThatHangsInTheLibraryDoesNotDisturbTheLoop) {
  GigaBench bench;
  bench.giga.wifi_hangs = true;
  bench.giga.stored["r4-settings"] = "network,lab\n";
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  bench.usb_lines();
  bench.run_ms(2000, host, bench.usb());
  EXPECT_TRUE(bench.active());
  EXPECT_NEAR(static_cast<double>(bench.usb_lines().size()), 204, 6);
}

TEST(GigaStop, IsObeyedOverEachTransport) {
  for (const char* transport : {"usb", "can", "emergency frame", "udp"}) {
    GigaBench bench;
    bench.giga.stored["r4-settings"] = "network,lab\npassword,correct%20horse\n";
    bench.boot();
    PlainHost host;
    const std::string name = transport;
    if (name == "udp") {
      ASSERT_TRUE(bench.run_until([&] {
        const std::lock_guard<std::mutex> lock(bench.giga.mutex);
        return bench.giga.udp_port != 0;
      }));
    }
    bench.drive(host, bench.usb());
    const std::string stop = with_crc("E:STOP;");
    if (name == "usb") bench.usb()(stop);
    if (name == "can") bench.can()(stop);
    if (name == "udp") bench.udp()(stop);
    if (name == "emergency frame") {
      CanFrame frame{};
      frame.id = emergency_stop_id;
      ASSERT_TRUE(bench.giga.can.deliver(frame));
    }
    if (name == "udp") {
      bench.run_until([&] { return bench.reason() == SafeReason::stop; });
    } else {
      bench.run_ms(3);
    }
    EXPECT_EQ(bench.reason(), SafeReason::stop) << name;
    EXPECT_TRUE(bench.pins().is_safe()) << name;
  }
}

TEST(GigaWatchdog, IsFedByTheGuardAsLongAsTheLoopTurns) {
  GigaBench bench;
  bench.boot();
  const int feeds = bench.giga.watchdog_feeds;
  bench.run_ms(1000);
  EXPECT_GT(bench.giga.watchdog_feeds - feeds, 300);
}

TEST(GigaWatchdog, ALoopThatHangsIsSafeSoonAndResetsTheBoardWhichStaysSafe) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  std::uint64_t safe_after_ms = 0;
  const std::uint64_t hung_ms = bench.giga.now_ms();
  EXPECT_TRUE(bench.giga.reset_by([&] {
    for (int ms = 0; ms < 5000; ++ms) {  // the loop does not come back; the timers do
      bench.giga.pass_ms(1);
      if (safe_after_ms == 0 && bench.pins().is_safe()) {
        safe_after_ms = bench.giga.now_ms() - hung_ms;
      }
    }
  }));
  EXPECT_GT(safe_after_ms, 0U);
  EXPECT_LE(safe_after_ms, 125U) << "five deadlines of 20 ms";
  EXPECT_LE(bench.giga.now_ms() - hung_ms, 450U);

  bench.system.reset();
  bench.giga.connect_registers();
  bench.boot();
  PlainHost again;
  bench.run_ms(150, again, bench.usb());
  EXPECT_EQ(bench.reason(), SafeReason::watchdog);
  bench.usb()(again.command("O:358,1,1"));
  bench.run_ms(20);
  EXPECT_TRUE(bench.pins().is_safe());
  bench.run_ms(1100, again, bench.usb());
  bench.usb()(again.command("E:CLEAR"));
  bench.usb()(again.command("O:358,1,1"));
  bench.run_ms(20);
  EXPECT_EQ(bench.pins().osmc[0].pwm, 358);
}

TEST(GigaWatchdog, BitesWhenEvenTheTimerInterruptIsDead) {
  GigaBench bench;
  bench.boot();
  EXPECT_TRUE(bench.giga.reset_by([&] {
    bench.giga.primask = 1;
    bench.giga.pass_ms(2000);
  }));
  bench.restart();
  EXPECT_EQ(bench.reason(), SafeReason::watchdog);
}

TEST(GigaFault, AProcessorFaultSwitchesEverythingOffAndIsReportedByTheNextBoot) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  ASSERT_EQ(bench.giga.vectors.count(HardFault_IRQn), 1U);
  r4_fake_scb.CFSR.value = 0x8200;
  EXPECT_TRUE(bench.giga.reset_by([&] { bench.giga.vectors[HardFault_IRQn](); }));
  EXPECT_TRUE(bench.pins().is_safe());
  bench.restart();
  EXPECT_EQ(bench.reason(), SafeReason::fault);
  bench.usb()("report");
  bench.run_ms(400);
  EXPECT_TRUE(has_line(bench.usb_lines(), "fault, exception 3, pc 0x00, status 0x8200"));
}

TEST(GigaFault, InTheMiddleOfATransferEverythingIsSwitchedOffAllTheSame) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  for (int after_bytes = 0; after_bytes < 6; ++after_bytes) {
    bench.giga.i2c.hold_after(after_bytes, 4);
    if (!bench.giga.reset_by([&] {
          bench.usb()(host.command("O:" + std::to_string(400 + after_bytes) + ",1,1"));
          bench.run_ms(2);
          bench.giga.vectors[BusFault_IRQn]();
        })) {
      ADD_FAILURE() << "no reset";
    }
    EXPECT_TRUE(bench.pins().is_safe()) << after_bytes;
    bench.restart();
    bench.run_ms(150, host, bench.usb());
    bench.run_ms(1100, host, bench.usb());
    bench.usb()(host.command("E:CLEAR"));
    bench.run_ms(20);
  }
}

TEST(GigaFault, AnErrorOfTheCoreEndsTheBootInsteadOfBlinkingForEver) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  EXPECT_TRUE(bench.giga.reset_by([] { r4_fake_core_error(-5, 0x08040000); }));
  EXPECT_TRUE(bench.pins().is_safe());
  EXPECT_TRUE(bench.giga.reset_by([] { mbed_die(); }));
}

TEST(GigaBus, AStuckBusCostsTheLoopAtMostItsBound) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  bench.giga.i2c.hold_scl(true);
  std::uint64_t longest_us = 0;
  for (int i = 0; i < 500; ++i) {
    const std::uint64_t before = bench.giga.now_ns();
    bench.system->poll();
    longest_us = std::max(longest_us, (bench.giga.now_ns() - before) / 1000);
    giga::rest();
  }
  EXPECT_EQ(bench.reason(), SafeReason::fault);
  EXPECT_LT(longest_us, 10000U);
  RecordProperty("longest_turn_us", static_cast<int>(longest_us));
  bench.giga.i2c.hold_scl(false);
  bench.run_ms(500, host, bench.usb());
  bench.run_ms(1100, host, bench.usb());
  bench.usb()(host.command("E:CLEAR"));
  bench.usb()(host.command("O:358,1,1"));
  bench.run_ms(20);
  EXPECT_EQ(bench.pins().osmc[0].pwm, 358) << "it comes back";
}

TEST(GigaSettings, SurviveARestart) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.run_ms(150, host, bench.usb());
  bench.usb()(host.command("C:rate,50"));
  bench.usb()(host.command("C:timeout,1500"));
  bench.usb()(host.command("C:node,7"));
  bench.usb()(host.command("C:AIN24,33.00"));
  bench.run_ms(20);
  ASSERT_TRUE(bench.run_until([&] {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    return bench.giga.writes == 1;
  })) << "all of them at once, when they have settled";
  bench.giga.analog[0x24] = 0x8000;
  bench.restart();
  const Settings& settings = bench.application().settings();
  EXPECT_EQ(settings.state_rate_hz, 50);
  EXPECT_EQ(settings.timeout_ms, 1500);
  EXPECT_EQ(settings.site.can_node, 7);
  PlainHost again;
  bench.run_ms(200, again, bench.usb());
  EXPECT_TRUE(has_line(bench.usb_lines(), "AIN24:16.50;"));
}

TEST(GigaSettings, AreNotKeptWhereAUsersFilesMayBe) {
  GigaBench bench;
  bench.giga.partition_size = 8 * 1024 * 1024;
  bench.boot();
  PlainHost host;
  bench.run_ms(150, host, bench.usb());
  bench.usb()(host.command("C:rate,50"));
  bench.run_ms(2500, host, bench.usb());
  EXPECT_EQ(bench.giga.writes, 0);
  bench.usb_lines();
  bench.usb()("report");
  bench.run_ms(400);
  EXPECT_TRUE(has_line(bench.usb_lines(), "Settings: not kept"));
}

TEST(GigaSettings, TellWhichChipsAreFitted) {
  GigaBench bench;
  bench.giga.stored["r4-settings"] = "chips,17\n";  // OSMC and servos
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  bench.giga.i2c.log.clear();
  bench.run_ms(200, host, bench.usb());
  for (const auto& transfer : bench.giga.i2c.log) {
    EXPECT_TRUE(transfer[0] >> 1 == 0x40 || transfer[0] >> 1 == 0x42) << int{transfer[0]};
  }
}

TEST(GigaSettings, ForTheNetworkAreRefusedOverCan) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.run_ms(150, host, bench.can());
  bench.can()(host.command("C:network,evil"));
  bench.run_ms(50);
  EXPECT_TRUE(has_line(bench.can_datagrams, ",AUTH;"));
  EXPECT_STREQ(bench.application().settings().site.network, "");
}

TEST(GigaReport, IsThePapersFigure3) {
  GigaBench bench;
  bench.giga.stored["r4-settings"] = "network,lab\npassword,correct%20horse\n";
  bench.boot();
  ASSERT_TRUE(bench.run_until([&] {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    return bench.giga.udp_port != 0;
  }));
  bench.run_ms(20);
  bench.usb_lines();
  bench.usb()("report");
  bench.run_ms(500);
  std::vector<std::string> lines = bench.usb_lines();
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
      "CAN: node 1, active, errors sent 0, received 0, bus-offs 0",
      "Settings: kept in the key-value store",
      "PCA9685 0x40 (OSMC): ok",
      "PCA9685 0x41 (DHB12): ok",
      "MCP23017 0x20 (relays, BLDC direction and brake): ok",
      "MCP4728 0x61 (BLDC speed): ok",
      "PCA9685 0x42 (servos): ok",
      "Last boot ended by: power or reset",
  };
  EXPECT_EQ(lines, expected);
}

TEST(GigaPins, CarryStepsEncodersEchoesAndVoltages) {
  GigaBench bench;
  bench.giga.analog[0x24] = 0xFFFF;
  bench.giga.set_pin('J', 0, false);
  bench.giga.set_pin('J', 1, false);
  bench.boot();
  PlainHost host;
  bench.run_ms(150, host, bench.usb());
  bench.usb()(host.command("F:STEP1POS,ENC1,US1,AIN24"));
  bench.usb()(host.command("P:20,1000,1"));
  bench.run_ms(10);
  bool levels[2] = {};
  for (int i = 0; i < 8; ++i) {  // two cycles forward: A leads
    levels[i % 2] = !levels[i % 2];
    bench.giga.set_pin('J', i % 2, levels[i % 2]);
  }
  bench.run_ms(100, host, bench.usb());
  const std::vector<std::string> lines = bench.usb_lines();
  EXPECT_TRUE(has_line(lines, "STEP1POS:20;"));
  EXPECT_TRUE(has_line(lines, "ENC1:8;"));
  EXPECT_TRUE(has_line(lines, "AIN24:50.00;"));
  EXPECT_FALSE(bench.giga.pin('A', 3)) << "the last step's pulse has ended";
  EXPECT_TRUE(bench.giga.pin('K', 5)) << "forward";

  bool answered = false;
  for (int i = 0; i < 600 && !answered; ++i) {
    bench.turn();
    if (!bench.giga.pin('I', 14)) continue;  // the trigger of sensor 1
    while (bench.giga.pin('I', 14)) bench.turn();
    bench.giga.set_pin('I', 10, true);
    bench.giga.pass_us(100 * 58);
    bench.giga.set_pin('I', 10, false);
    answered = true;
  }
  ASSERT_TRUE(answered);
  bench.run_ms(50, host, bench.usb());
  EXPECT_TRUE(has_line(bench.usb_lines(), "US1:100;"));
}

TEST(GigaLight, TellsTheState) {
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
