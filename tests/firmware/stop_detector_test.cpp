// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/stop_detector.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "tests/support/datagrams.hpp"
#include "tests/support/signing.hpp"

namespace r4::firmware {
namespace {

using test::with_crc;

int stops_in(StopDetector& detector, const std::string& bytes) {
  int stops = 0;
  for (const char byte : bytes) stops += detector.push(byte) ? 1 : 0;
  return stops;
}

TEST(StopDetector, DetectsOnlyStopsAndAtAnyPositionOfADatagram) {
  const struct {
    const char* fields;
    bool stop;
  } cases[] = {
      {"E:STOP;PNum:1;T:2;", true},         {"E:STOP;", true},
      {"O:1,1,1;E:STOP;PNum:1;T:2;", true}, {"PNum:1;T:2;E:STOP;", true},
      {"E:CLEAR;PNum:1;T:2;", false},       {"E:STOPP;PNum:1;T:2;", false},
      {"XE:STOP;PNum:1;T:2;", false},       {"O:1,1,E:STOP;PNum:1;T:2;", false},
      {"E:STOP,1;PNum:1;T:2;", false},      {"O:358,1,1;PNum:1;T:2;", false},
  };
  for (const auto& c : cases) {
    const std::string datagram = with_crc(c.fields);
    EXPECT_EQ(is_stop(Text(datagram)), c.stop) << c.fields;
    StopDetector detector;
    EXPECT_EQ(stops_in(detector, datagram + "\r\n"), c.stop ? 1 : 0) << c.fields;
    const std::string line = datagram + "\n";
    EXPECT_EQ(stops_in(detector, line + line), c.stop ? 2 : 0) << c.fields;
    EXPECT_EQ(stops_in(detector, datagram), 0) << "the datagram has not ended: " << c.fields;
  }
}

TEST(StopDetector, IgnoresAStopWithOneWrongBit) {
  const std::string datagram = with_crc("E:STOP;PNum:7;T:79146;");
  for (std::size_t i = 0; i < datagram.size() * 8; ++i) {
    std::string damaged = datagram;
    damaged[i / 8] = static_cast<char>(damaged[i / 8] ^ 1 << i % 8);
    if (damaged[i / 8] == '\r' || damaged[i / 8] == '\n') continue;
    StopDetector detector;
    const bool hexadecimal_in_the_other_case = i / 8 > datagram.find('^') && i % 8 == 5;
    if (hexadecimal_in_the_other_case) continue;
    EXPECT_EQ(stops_in(detector, damaged + "\n"), 0) << damaged;
  }
}

TEST(StopDetector, DetectsASignedStopWithTheLongestNumbers) {
  const std::string fields =
      test::with_signature("E:STOP;PNum:4294967295;T:18446744073709551615;",
                           test::key_of(max_key_id), "0123456789abcdef", UINT64_MAX, UINT32_MAX);
  const std::string longest_checksum = "^0x01234567^";
  EXPECT_LE(fields.size() + longest_checksum.size(), StopDetector::max_line);
  const std::string datagram = with_crc(fields);
  EXPECT_TRUE(is_stop(Text(datagram)));
  StopDetector detector;
  EXPECT_EQ(stops_in(detector, datagram + "\r\n" + datagram + "\n"), 2) << datagram;
}

TEST(StopDetector, DetectsAStopAfterALineThatIsTooLong) {
  StopDetector detector;
  const std::string stop = with_crc("E:STOP;PNum:7;T:79146;");
  EXPECT_EQ(stops_in(detector, std::string(5000, 'x') + stop + "\n"), 0);
  EXPECT_EQ(stops_in(detector, stop + "\n"), 1);
  const std::string longest(StopDetector::max_line - stop.size(), ' ');
  EXPECT_EQ(stops_in(detector, stop + longest + "x\n" + stop + "\n"), 1);
}

TEST(StopDetector, ForgetsAnUnfinishedLineWhenItIsReset) {
  StopDetector detector;
  const std::string stop = with_crc("E:STOP;PNum:7;T:79146;") + "\n";
  EXPECT_EQ(stops_in(detector, "O:358,1"), 0);
  detector.reset();
  EXPECT_EQ(stops_in(detector, stop), 1);
}

}  // namespace
}  // namespace r4::firmware
