// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/r4/bus/bus_log.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "r4link/messages/packed_form.hpp"
#include "tests/support/datagrams.hpp"

namespace r4::tool {
namespace {

// A dump that the test writes, and the lines that are printed for the dump.
struct Dump {
  void frame(std::uint32_t id, std::string_view hex, const char* interface = "can0") {
    log.on_line(++line, fmt::format("({}.{:06}) {} {:03X}#{}", at_us / 1000000, at_us % 1000000,
                                    interface, id, hex));
    at_us += 250;
  }
  // Appends the frames of a datagram. An answer of `flow_control_id` follows the first frame.
  void datagram(std::uint32_t id, const std::string& bytes, std::uint32_t flow_control_id = 0,
                std::size_t lose = 999) {
    std::vector<std::string> frames{fmt::format("1{:03X}", bytes.size())};
    for (std::size_t i = 0, serial = 1; i < bytes.size(); ++i) {
      if (frames.back().size() == 16) frames.push_back(fmt::format("2{:X}", serial++ & 15));
      frames.back() += fmt::format("{:02X}", static_cast<unsigned char>(bytes[i]));
    }
    for (std::size_t i = 0; i < frames.size(); ++i) {
      if (i != lose) frame(id, frames[i]);
      if (i == 0 && flow_control_id != 0) frame(flow_control_id, "300000");
    }
  }
  Json summary() {
    log.finish();
    return printed.back();
  }

  std::vector<Json> printed;
  BusLog log{[this](const Json& object) { printed.push_back(object); }};
  std::uint64_t line = 0;
  std::uint64_t at_us = 1436509052000000;
};

const std::string state = test::with_crc("AIN24:23.50;AIN12:12.10;OSMC1:358,1;PNum:77;T:81234;");
const std::string command = test::with_crc("O:358,1,1;PNum:2147483650;T:81234;");
const std::string answer = test::with_crc("N:2147483650,RANGE;PNum:78;T:81240;");

TEST(BusLog, ShowsSenderLaneAndTypeOfEachDatagram) {
  Dump dump;
  dump.datagram(0x403, state);
  dump.datagram(0x183, command, 0x203);
  dump.datagram(0x203, answer, 0x183);
  ASSERT_EQ(dump.printed.size(), 3U);
  const std::vector<std::string> from{"board", "host", "board"};
  const std::vector<std::string> lanes{"telemetry", "command", "reply"};
  const std::vector<std::string> types{"state", "command", "nack"};
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(dump.printed[i]["from"], from[i]);
    EXPECT_EQ(dump.printed[i]["lane"], lanes[i]);
    EXPECT_EQ(dump.printed[i]["type"], types[i]);
    EXPECT_EQ(dump.printed[i]["node"], 3);
    EXPECT_EQ(dump.printed[i]["interface"], "can0");
    EXPECT_EQ(dump.printed[i]["ok"], true);
  }
  EXPECT_EQ(dump.printed[0]["text"], state);
  EXPECT_EQ(dump.printed[0]["frames"], (state.size() + 1 + 6) / 7);
  EXPECT_EQ(dump.printed[0]["line"], dump.printed[0]["frames"]);
  EXPECT_DOUBLE_EQ(dump.printed[0]["took_ms"].get<double>(),
                   0.25 * (dump.printed[0]["frames"].get<int>() - 1));
  EXPECT_FALSE(dump.log.any_bad());
  EXPECT_EQ(dump.summary()["flow_control"], 2);
}

TEST(BusLog, DistinguishesInterfacesAndNodes) {
  Dump dump;
  dump.frame(0x401, "100A48656C6C6F2C");
  dump.frame(0x402, "100A48656C6C6F2C");
  dump.frame(0x401, "100A48656C6C6F2C", "can1");
  EXPECT_TRUE(dump.printed.empty());
  dump.frame(0x401, "2120796F75", "can1");
  dump.frame(0x402, "2120796F75");
  dump.frame(0x401, "2120796F75");
  ASSERT_EQ(dump.printed.size(), 3U);
  EXPECT_EQ(dump.printed[0]["interface"], "can1");
  EXPECT_EQ(dump.printed[1]["node"], 2);
  EXPECT_EQ(dump.printed[2]["node"], 1);
}

TEST(BusLog, UnpacksThePackedForm) {
  Dump dump;
  std::array<std::uint8_t, max_datagram> bytes{};
  const std::size_t size = pack(Text(state), bytes.data(), bytes.size());
  ASSERT_NE(size, 0U);
  dump.datagram(0x400, std::string(bytes.begin(), bytes.begin() + static_cast<int>(size)));
  ASSERT_EQ(dump.printed.size(), 1U);
  EXPECT_EQ(dump.printed[0]["packed"], size);
  EXPECT_EQ(dump.printed[0]["text"], state);
  EXPECT_EQ(dump.printed[0]["pnum"], 77);
  dump.frame(0x400, "05C000000000");
  EXPECT_EQ(dump.printed[1]["error"], "packed");
  EXPECT_EQ(dump.printed[1]["reason"], "version");
  EXPECT_EQ(dump.printed[1]["text"], "packed:c000000000");
  EXPECT_TRUE(dump.log.any_bad());
}

TEST(BusLog, ShowsEmergencyStopsBoardsThatWentSafeAndWatchers) {
  Dump dump;
  dump.frame(0x010, "");
  dump.frame(0x025, "02");
  dump.frame(0x025, "63");
  dump.frame(0x605, "");
  ASSERT_EQ(dump.printed.size(), 4U);
  EXPECT_EQ(dump.printed[0]["type"], "emergency_stop");
  EXPECT_EQ(dump.printed[0]["from"], "host");
  EXPECT_EQ(dump.printed[1]["type"], "went_safe");
  EXPECT_EQ(dump.printed[1]["reason"], "stop");
  EXPECT_EQ(dump.printed[1]["node"], 5);
  EXPECT_EQ(dump.printed[2]["reason"], "fault");
  EXPECT_EQ(dump.printed[3]["type"], "watch");
  EXPECT_EQ(dump.printed[3]["node"], 5);
  EXPECT_FALSE(dump.log.any_bad());
  dump.frame(0x025, "");
  EXPECT_EQ(dump.printed[4]["ok"], false);
}

TEST(BusLog, ReportsFailedTransfers) {
  Dump dump;
  dump.datagram(0x403, state, 0, 3);
  ASSERT_EQ(dump.printed.size(), 1U);
  EXPECT_EQ(dump.printed[0]["error"], "isotp");
  EXPECT_EQ(dump.printed[0]["reason"], "wrong sequence number");
  EXPECT_EQ(dump.printed[0]["frames"], 3);
  EXPECT_EQ(dump.printed[0]["line"], 4);

  dump.frame(0x403, "100A48656C6C6F2C");
  dump.frame(0x403, "100A48656C6C6F2C");
  ASSERT_EQ(dump.printed.size(), 2U);
  EXPECT_EQ(dump.printed[1]["reason"], "interrupted by another transfer");

  dump.at_us += 101000;
  dump.frame(0x777, "");
  ASSERT_EQ(dump.printed.size(), 3U);
  EXPECT_EQ(dump.printed[2]["reason"], "the next consecutive frame did not come in time (N_Cr)");

  dump.frame(0x183, "100A48656C6C6F2C");
  dump.at_us += 121000;
  dump.frame(0x777, "");
  ASSERT_EQ(dump.printed.size(), 4U);
  EXPECT_EQ(dump.printed[3]["reason"], "flow control did not come in time (N_Bs)");

  dump.frame(0x403, "1FFF48656C6C6F2C");
  EXPECT_EQ(dump.printed[4]["reason"], "longer than the receiver's buffer");
  dump.frame(0x403, "FF");
  EXPECT_EQ(dump.printed[5]["reason"], "malformed frame");
  EXPECT_EQ(dump.summary()["failed"], 6);
}

TEST(BusLog, CountsFramesThatItDoesNotPrint) {
  Dump dump;
  dump.frame(0x403, "2148656C6C6F");  // the datagram began before the dump
  dump.frame(0x123, "00");
  dump.log.on_line(++dump.line, "(1436509052.5) can0 00000403#00");
  dump.log.on_line(++dump.line, "(1436509052.5) can0 20000004#0004000000000000");
  dump.log.on_line(++dump.line, "\tcontroller-problem{}");
  dump.frame(0x403, "100A48656C6C6F2C");  // the dump ends within this datagram
  EXPECT_TRUE(dump.printed.empty());
  EXPECT_FALSE(dump.log.any_bad());
  const Json summary = dump.summary();
  EXPECT_EQ(summary["frames"], 5);
  EXPECT_EQ(summary["orphans"], 1);
  EXPECT_EQ(summary["other"], 2);
  EXPECT_EQ(summary["error_frames"], 1);
  EXPECT_EQ(summary["unfinished"], 1);
}

TEST(BusLog, GoesOnAfterDamagedLinesAndJumpsInTime) {
  Dump dump;
  dump.log.on_line(++dump.line, "garbage");
  dump.log.on_long_line(++dump.line, 1000000);
  dump.at_us += 1000ULL * 86400 * 1000000;
  dump.datagram(0x403, state);
  dump.at_us = 5;
  dump.datagram(0x403, state);
  ASSERT_EQ(dump.printed.size(), 4U);
  EXPECT_EQ(dump.printed[0]["line"], 1);
  EXPECT_EQ(dump.printed[0]["fix"], "record with: candump -L INTERFACE");
  EXPECT_EQ(dump.printed[1]["size"], 1000000);
  EXPECT_EQ(dump.printed[2]["ok"], true);
  EXPECT_EQ(dump.printed[3]["ok"], true);
  EXPECT_TRUE(dump.log.any_bad());
}

TEST(BusLog, BoundsTheNumberOfInterfaces) {
  Dump dump;
  for (int i = 0; i < 100; ++i) dump.frame(0x010, "", fmt::format("can{}", i).c_str());
  EXPECT_EQ(dump.printed[BusTransfers::max_interfaces - 1]["ok"], true);
  EXPECT_EQ(dump.printed[BusTransfers::max_interfaces]["error"], "candump");
  EXPECT_EQ(dump.summary()["damaged_lines"], 100 - BusTransfers::max_interfaces);
}

}  // namespace
}  // namespace r4::tool
