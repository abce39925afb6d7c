// SPDX-License-Identifier: GPL-3.0-or-later
// The whole firmware on a fake Giga: its behaviour at power-up, over its transports, and when parts
// of it fail.
#include <algorithm>

#include "bench.hpp"
#include "tests/giga/core/registers.hpp"

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

TEST(GigaUsb, AHostThatStopsReadingDoesNotBlockTheLoop) {
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
  EXPECT_TRUE(bench.active()) << "the board still receives";
  bench.giga.usb_reads = true;
  bench.giga.usb_host.clear();
  bench.run_ms(60, host, bench.usb());
  const std::vector<std::string> lines = bench.usb_lines();
  ASSERT_GT(lines.size(), 3U);
  // The interrupted line ends first. After this line, no old line is sent.
  Datagram datagram;
  const std::string& second = lines[2];
  ASSERT_TRUE(read_datagram(Text(second.data(), second.size()), datagram)) << second;
  EXPECT_LT(giga::BoardClock::now_ms() - static_cast<std::uint32_t>(datagram.time_ms()), 100U);
}

TEST(GigaUsb, AnUploadAt1200BaudTurnsOutputsOffBeforeTheReset) {
  GigaBench bench;
  bench.giga.usb_open = false;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.can());
  bench.giga.usb_open = true;
  bench.giga.usb_baud = 1200;
  const std::uint64_t asked_ns = bench.giga.now_ns();
  bench.system->poll();
  EXPECT_TRUE(bench.pins().is_safe()) << "in the first turn";
  EXPECT_LE(bench.giga.now_ns() - asked_ns, 2000000U);
  EXPECT_EQ(bench.reason(), SafeReason::fault);

  // The board stays safe until the reset, whatever the host sends and whatever happens to the port.
  for (int i = 0; i < 300; ++i) {
    if (i == 100) bench.giga.usb_baud = 115200;
    if (i == 200) bench.giga.usb_open = false;
    if (i % 20 == 0) bench.can()(host.heartbeat(bench.giga.now_ms()));
    if (i % 20 == 5) bench.can()(host.command("E:CLEAR"));
    if (i % 20 == 10) bench.can()(host.command("O:358,1,1"));
    bench.turn();
    ASSERT_TRUE(bench.pins().is_safe()) << i;
    ASSERT_EQ(bench.reason(), SafeReason::fault) << i;
  }
  bench.giga.usb_baud = 115200;
  bench.restart();
  bench.drive(host, bench.can());
}

TEST(GigaUsb, ACommandAfterAClearDoesNotDriveDuringAnUpload) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  bench.giga.usb_baud = 1200;
  bench.usb()(host.command("E:CLEAR") + "\r\n" + host.command("O:358,1,1"));
  bench.system->poll();  // both commands in one turn
  EXPECT_TRUE(bench.pins().is_safe());
  EXPECT_EQ(bench.application().outputs().osmc[0].pwm, 0);
  EXPECT_EQ(bench.reason(), SafeReason::fault);
}

TEST(GigaUsb, ClosingThePortEndsTheSession) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  bench.giga.usb_open = false;
  bench.run_ms(5);
  EXPECT_EQ(bench.reason(), SafeReason::link);
  EXPECT_TRUE(bench.pins().is_safe());
}

TEST(GigaUsb, AProgramThatOpensThePortGetsNoOldDatagrams) {
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
  ASSERT_TRUE(read_datagram(Text(lines[0].data(), lines[0].size()), datagram)) << lines[0];
  EXPECT_LE(giga::BoardClock::now_ms() - static_cast<std::uint32_t>(datagram.time_ms()), 600U);
}

TEST(GigaUsb, APortClosedDuringAPacketServesTheNextProgram) {
  for (const std::uint64_t closed_ms : {0U, 1U, 200U}) {
    GigaBench bench;
    bench.boot();
    PlainHost host;
    bench.drive(host, bench.usb());
    bench.giga.usb_close_under_way();
    bench.run_ms(closed_ms);
    bench.giga.usb_open = true;
    bench.giga.usb_host.clear();
    PlainHost next;
    bench.run_ms(100, next, bench.usb());
    EXPECT_GE(bench.usb_lines().size(), 5U) << closed_ms;
    EXPECT_TRUE(bench.giga.usb_flushed) << "the old packet would come first";
    EXPECT_EQ(r4_fake_usb.device.DIEPEMPMSK.value, 0U);
  }
}

TEST(GigaUsb, APortThatIsClosedAndOpenedWithinATurnBeginsANewSession) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  bench.giga.usb_reads = false;
  bench.run_ms(50, host, bench.usb());
  bench.giga.usb_send("an unfinished line");
  bench.turn();
  bench.giga.usb_close_under_way();
  bench.giga.usb_open = true;
  bench.giga.usb_reads = true;
  bench.giga.usb_host.clear();
  const std::uint32_t opened_ms = giga::BoardClock::now_ms();
  PlainHost next;
  bench.usb()(next.heartbeat(bench.giga.now_ms()));
  bench.run_ms(50);
  EXPECT_TRUE(bench.pins().is_safe()) << "the session of the old program has ended";
  const std::vector<std::string> lines = bench.usb_lines();
  ASSERT_GE(lines.size(), 2U) << "the first line of the new program is lost";
  Datagram first;
  ASSERT_TRUE(read_datagram(Text(lines[0].data(), lines[0].size()), first)) << lines[0];
  EXPECT_GE(static_cast<std::uint32_t>(first.time_ms()), opened_ms) << "a waiting line";
}

TEST(GigaUsb, OpensItsEndpointOnlyWhenConfigured) {
  GigaBench bench;
  bench.boot();
  bench.giga.usb_close_under_way();
  bench.giga.usb_configured = false;
  bench.run_ms(50);
  EXPECT_FALSE(bench.giga.usb_endpoint_open());
  bench.giga.usb_configured = true;
  bench.run_ms(50);
  EXPECT_TRUE(bench.giga.usb_endpoint_open());
}

TEST(GigaUsb, AFloodOfInputDoesNotDisturbTheSession) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.can());
  bench.usb_lines();
  for (int i = 0; i < 20000; ++i) bench.giga.usb_send(std::string(64, i % 2 == 0 ? 'x' : '\n'));
  bench.system->poll();
  constexpr std::size_t in_ring = giga::UsbPort::receive_capacity / giga::UsbPort::packet_size;
  EXPECT_GE(bench.giga.usb_packets.size(), 20000 - in_ring - giga::UsbPort::packets_per_turn);
  bench.can_datagrams.clear();
  bench.run_ms(1000, host, bench.can());
  EXPECT_TRUE(bench.active());
  EXPECT_NEAR(static_cast<double>(bench.can_datagrams.size()), 102, 4);
}

TEST(GigaUsb, EndsNoBurstWithAFullPacket) {
  // A host's driver waits for more data after a packet of 64 bytes.
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
  EXPECT_GT(multiples, 0) << "the test needs a line that fills its packets";
  const auto& packets = bench.giga.usb_sent;
  for (std::size_t i = 0; i + 1 < packets.size(); ++i) {
    if (packets[i].size != giga::UsbPort::packet_size) continue;
    EXPECT_LE(packets[i + 1].at_ms - packets[i].at_ms, 2U);
  }
}

TEST(GigaUsb, StoresAndReportsItsName) {
  GigaBench bench;
  bench.store("name,left-arm\n");
  bench.boot();
  PlainHost host;
  const auto says = [&](const std::string& text) {
    bench.usb()(with_crc("Q:ID;"));
    bench.run_ms(20, host, bench.usb());
    const std::vector<std::string> lines = bench.usb_lines();
    return std::any_of(lines.begin(), lines.end(), [&](const std::string& line) {
      return line.find("I:R4,") == 0 && line.find(text) != std::string::npos;
    });
  };
  bench.run_ms(150, host, bench.usb());
  EXPECT_TRUE(says(";NAME:left-arm;BUSY:0;"));
  bench.usb()(host.command("C:name,right"));
  EXPECT_TRUE(says(";NAME:right;BUSY:0;"));
  EXPECT_TRUE(bench.run_until([&] {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    return bench.giga.stored["r4-settings"].find("name,right\n") != std::string::npos;
  }));
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

TEST(GigaWiFi, JoinsAnOpenNetwork) {
  GigaBench bench;
  bench.giga.air_password = "";
  bench.store("network,lab\n");
  bench.boot();
  EXPECT_TRUE(bench.run_until([&] {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    return bench.giga.wifi_connected && bench.giga.udp_port == 2018;
  }));
}

TEST(GigaWiFi, AThreadThatHangsInTheLibraryDoesNotDisturbTheLoop) {
  GigaBench bench;
  bench.giga.wifi_hangs = true;
  bench.store("network,lab\n");
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  bench.usb_lines();
  bench.run_ms(2000, host, bench.usb());
  EXPECT_TRUE(bench.active());
  EXPECT_NEAR(static_cast<double>(bench.usb_lines().size()), 204, 6);
}

TEST(GigaWiFi, RejoinsALostNetworkAndRetriesAWrongPassword) {
  GigaBench bench;
  bench.store("network,lab\npassword,wrong-one\n");
  bench.boot();
  const auto joins = [&] {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    return bench.giga.joins;
  };
  const auto up = [&] {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    return bench.giga.udp_port != 0;
  };
  ASSERT_TRUE(bench.run_until([&] { return joins() >= 3; }));
  EXPECT_FALSE(up());
  {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    bench.giga.air_password = "wrong-one";
  }
  ASSERT_TRUE(bench.run_until(up));
  const int before = joins();
  {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    bench.giga.wifi_connected = false;
  }
  ASSERT_TRUE(bench.run_until([&] { return joins() > before && up(); }));
}

TEST(GigaWiFi, LosingTheNetworkMakesTheOutputsSafeAtOnce) {
  GigaBench bench;
  ASSERT_TRUE(bench.boot_in_network());
  PlainHost host;
  std::uint64_t next_ms = 0;
  ASSERT_TRUE(bench.run_until([&] {
    if (bench.giga.now_ms() < next_ms) return false;
    next_ms = bench.giga.now_ms() + 100;
    bench.udp()(host.heartbeat(next_ms));
    bench.udp()(host.command("O:358,1,1"));
    return bench.pins().osmc[0].pwm == 358;
  }));
  {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    bench.giga.wifi_connected = false;
    bench.giga.air.clear();
  }
  ASSERT_TRUE(bench.run_until([&] {
    if (bench.giga.now_ms() >= next_ms) {
      next_ms = bench.giga.now_ms() + 100;
      bench.udp()(host.heartbeat(next_ms));
    }
    return bench.pins().is_safe();
  }));
  EXPECT_EQ(bench.reason(), SafeReason::link);
}

TEST(GigaWiFi, ANewCalibrationDoesNotDropTheNetwork) {
  GigaBench bench;
  bench.store("network,lab\npassword,correct%20horse\n");
  bench.boot();
  const auto joins = [&] {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    return bench.giga.joins;
  };
  ASSERT_TRUE(bench.run_until([&] { return joins() == 1; }));
  PlainHost host;
  bench.run_ms(150, host, bench.usb());
  bench.usb()(host.command("C:AIN24,33.00"));
  bench.usb()(host.command("C:host,192.168.0.117"));
  ASSERT_TRUE(bench.run_until([&] {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    return std::any_of(bench.giga.udp_out.begin(), bench.giga.udp_out.end(),
                       [](const fake::Datagram& datagram) { return datagram.port == 2390; });
  })) << "the board sends to the new host";
  EXPECT_EQ(joins(), 1);
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

TEST(GigaPins, VoltagesAreConvertedWithoutTheCore) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.run_ms(150, host, bench.usb());
  const int by_core = bench.giga.core_conversions;
  EXPECT_EQ(by_core, analog_channels) << "at the start only";
  bench.giga.analog = {{0x24, 6554},  {0x25, 13108}, {0x10, 19662},
                       {0x11, 26215}, {0x23, 32769}, {0x22, 39322}};
  bench.usb()(host.command("F:AIN24,AIN12,AIN5,AINDMH,AINSTEER,AIN6"));
  bench.run_ms(100, host, bench.usb());
  const std::vector<std::string> lines = bench.usb_lines();
  for (const char* field : {"AIN24:5.00;", "AIN12:10.00;", "AIN5:15.00;", "AINDMH:20.00;",
                            "AINSTEER:25.00;", "AIN6:30.00;"}) {
    EXPECT_TRUE(has_line(lines, field)) << field;
  }
  EXPECT_EQ(bench.giga.core_conversions, by_core);

  bench.giga.converter_hangs = true;
  bench.run_ms(100, host, bench.usb());
  const std::vector<std::string> hung = bench.usb_lines();
  for (const char* field : {"AIN24:0.00;", "AIN12:0.00;", "AIN5:0.00;", "AINDMH:0.00;",
                            "AINSTEER:0.00;", "AIN6:0.00;"}) {
    EXPECT_TRUE(has_line(hung, field)) << field << " is an old voltage";
  }
}

// --- the wiring of each channel, as in the table of docs/how-to/firmware.md

// The pins of one channel of each kind.
struct Wires {
  giga::Pin step, direction, a, b, index, trigger, echo;
};
constexpr Wires wires[] = {
    {{'A', 3}, {'K', 5}, {'J', 0}, {'J', 1}, {'J', 14}, {'I', 14}, {'I', 10}},
    {{'A', 2}, {'K', 6}, {'J', 2}, {'J', 3}, {'J', 15}, {'H', 15}, {'I', 11}},
    {{'J', 8}, {'E', 6}, {'J', 4}, {'J', 5}, {'K', 3}, {'G', 12}, {'J', 12}},
    {{'A', 7}, {'K', 7}, {'J', 6}, {'J', 7}, {'K', 4}, {'I', 13}, {'G', 13}},
};

class GigaWiring : public testing::TestWithParam<int> {
 protected:
  GigaWiring() {
    for (const Wires& each : wires) {
      for (const giga::Pin pin : {each.a, each.b, each.index, each.echo}) set(pin, false);
    }
    bench_.boot();
    bench_.run_ms(150, host_, bench_.usb());
  }
  int channel() const { return GetParam(); }
  const Wires& mine() const { return wires[channel() - 1]; }
  void set(giga::Pin pin, bool high) { bench_.giga.set_pin(pin.port, pin.number, high); }
  bool pin(giga::Pin pin) { return bench_.giga.pin(pin.port, pin.number); }
  void command(const std::string& field) { bench_.usb()(host_.command(field)); }
  void run_ms(std::uint64_t ms) { bench_.run_ms(ms, host_, bench_.usb()); }
  // Expects `value` in the field of this channel of the newest state, and 0 in the fields of the
  // other channels.
  void expect_state(const char* name, const char* suffix, int value) {
    const std::vector<std::string> lines = bench_.usb_lines();
    const auto state = std::find_if(lines.rbegin(), lines.rend(), [&](const std::string& line) {
      return line.find(std::string(name) + "1" + suffix + ":") != std::string::npos;
    });
    ASSERT_NE(state, lines.rend());
    for (int i = 1; i <= 4; ++i) {
      const std::string field = name + std::to_string(i) + suffix + ":" +
                                std::to_string(i == channel() ? value : 0) + ";";
      EXPECT_NE(state->find(field), std::string::npos) << field << " is not in " << *state;
    }
  }

  GigaBench bench_;
  PlainHost host_;
};

TEST_P(GigaWiring, AStepperStepsAtItsOwnPins) {
  command("F:STEP1POS,STEP2POS,STEP3POS,STEP4POS");
  command("P:20,1000," + std::to_string(channel()));
  run_ms(50);
  expect_state("STEP", "POS", 20);
  EXPECT_TRUE(pin(mine().direction)) << "forward";
  command("P:-5,1000," + std::to_string(channel()));
  run_ms(50);
  expect_state("STEP", "POS", -5);
  for (const Wires& each : wires) {
    EXPECT_EQ(bench_.giga.rises(each.step.port, each.step.number), &each == &mine() ? 45 : 0);
    EXPECT_EQ(bench_.giga.rises(each.direction.port, each.direction.number),
              &each == &mine() ? 1 : 0);
    EXPECT_FALSE(pin(each.step)) << "the pulse of the last step has ended";
    EXPECT_FALSE(pin(each.direction)) << "backward, or as after power-up";
  }
}

TEST_P(GigaWiring, AnEncoderCountsItsOwnLines) {
  command("F:ENC1,ENC2,ENC3,ENC4,ENC1IDX,ENC2IDX,ENC3IDX,ENC4IDX");
  bool levels[2] = {};
  const auto turn = [&](int edges) {  // forward: A leads
    for (int i = 0; i < edges; ++i) {
      levels[i % 2] = !levels[i % 2];
      set(i % 2 == 0 ? mine().a : mine().b, levels[i % 2]);
    }
  };
  turn(8);
  set(mine().index, true);
  run_ms(2);
  set(mine().index, false);
  turn(4);
  run_ms(50);
  const std::vector<std::string> lines = bench_.usb_lines();
  ASSERT_FALSE(lines.empty());
  for (int i = 1; i <= 4; ++i) {
    const bool its_own = i == channel();
    const std::string n = std::to_string(i);
    EXPECT_TRUE(has_line({lines.back()}, "ENC" + n + (its_own ? ":12;" : ":0;"))) << lines.back();
    EXPECT_TRUE(has_line({lines.back()}, "ENC" + n + (its_own ? "IDX:8;" : "IDX:0;")))
        << lines.back();
  }
}

TEST_P(GigaWiring, AnEchoBelongsToTheTriggeredSensor) {
  command("F:US1,US2,US3,US4");
  bool answered = false;
  for (int i = 0; i < 600 && !answered; ++i) {
    bench_.turn();
    if (!pin(mine().trigger)) continue;
    while (pin(mine().trigger)) bench_.turn();
    set(mine().echo, true);
    bench_.giga.pass_us(100 * 58);
    set(mine().echo, false);
    answered = true;
  }
  ASSERT_TRUE(answered);
  run_ms(50);
  expect_state("US", "", 100);
}

INSTANTIATE_TEST_SUITE_P(Channels, GigaWiring, testing::Range(1, 5));

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
