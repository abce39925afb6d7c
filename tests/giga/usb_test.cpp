// SPDX-License-Identifier: GPL-3.0-or-later
// The firmware on a fake Giga over USB: sessions, uploads, hosts that do not read.
#include <algorithm>

#include "bench.hpp"

namespace r4::test {
namespace {

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

}  // namespace
}  // namespace r4::test
