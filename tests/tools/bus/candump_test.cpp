// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/r4/bus/candump.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <string_view>
#include <vector>

namespace r4::tool {
namespace {

std::vector<int> bytes_of(const CanFrame& frame) { return {frame.data, frame.data + frame.size}; }

struct Good {
  const char* text;
  std::uint32_t id;
  std::vector<int> bytes;
  bool fd = false;
};

TEST(Candump, ReadsBothFormatsWithTheExtrasOfItsOptions) {
  const std::vector<int> four{0x2A, 0x36, 0x6C, 0x2B};
  const std::vector<int> twelve{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12};
  for (const Good& good : {
           Good{"(1436509052.249713) vcan0 244#2A366C2B", 0x244, four},
           Good{"(1436509052.249713) vcan0 244#2A366C2B T", 0x244, four},
           Good{"(1436509052.249713) vcan0 244#", 0x244, {}},
           Good{"(1436509052.249713) vcan0 244##3", 0x244, {}, true},
           Good{"(1436509052.249713) vcan0 244##12A366C2B", 0x244, four, true},
           Good{"(1436509052.249713) vcan0 244##10102030405060708090A0B0C", 0x244, twelve, true},
           Good{
               "(1436509052.249713) vcan0 244#0102030405060708_F", 0x244, {1, 2, 3, 4, 5, 6, 7, 8}},
           Good{"  vcan0  244   [4]  2A 36 6C 2B", 0x244, four},
           Good{"  vcan0  244   [4]  2a 36 6c 2b   '*6l+'", 0x244, four},
           Good{"  vcan0  244  [04]  2A 36 6C 2B", 0x244, four, true},
           Good{"  vcan0  244  [12]  01 02 03 04 05 06 07 08 09 0A 0B 0C", 0x244, twelve, true},
           Good{"  vcan0  244   [0] ", 0x244, {}},
           Good{" (1436509052.249713)  vcan0  TX B -  244   [4]  2A 36 6C 2B", 0x244, four},
           Good{" (000.000123)  vcan0  RX - E  244   [4]  2A 36 6C 2B", 0x244, four},
           Good{" (2015-07-10 08:17:32.249713)  vcan0  244   [4]  2A 36 6C 2B", 0x244, four},
       }) {
    CandumpLine line;
    ASSERT_EQ(read_candump_line(good.text, line), CandumpError::none) << good.text;
    EXPECT_EQ(line.interface, "vcan0");
    EXPECT_EQ(line.frame.id, good.id);
    EXPECT_EQ(bytes_of(line.frame), good.bytes) << good.text;
    EXPECT_EQ(line.frame.fd, good.fd) << good.text;
    EXPECT_FALSE(line.frame.extended || line.frame.remote || line.error_frame) << good.text;
  }
}

TEST(Candump, RecognizesFramesThatR4DoesNotUse) {
  CandumpLine line;
  ASSERT_EQ(read_candump_line("(1.0) can0 00000244#00", line), CandumpError::none);
  EXPECT_TRUE(line.frame.extended);
  ASSERT_EQ(read_candump_line("(1.0) can0 244#R", line), CandumpError::none);
  EXPECT_TRUE(line.frame.remote);
  for (const char* const size : {"[0]", "[4]"}) {
    const std::string text = std::string("  can0  244   ") + size + "  remote request";
    ASSERT_EQ(read_candump_line(text, line), CandumpError::none) << text;
    EXPECT_TRUE(line.frame.remote) << text;
  }
  ASSERT_EQ(read_candump_line("(1.0) can0 20000004#0004000000000000", line), CandumpError::none);
  EXPECT_TRUE(line.error_frame);
  ASSERT_EQ(read_candump_line("  can0  20000004   [8]  00 04 00 00 00 00 00 00   ERRORFRAME", line),
            CandumpError::none);
  EXPECT_TRUE(line.error_frame);
  EXPECT_EQ(read_candump_line("\tcontroller-problem{rx-error-warning}", line),
            CandumpError::detail);
}

TEST(Candump, ReadsLinesOfNewerCandumpForFramesThatR4DoesNotUse) {
  for (const char* const text :
       {"(1.0) can0 244#R8", "(1.0) can0 244#R8_B", "(1.0) can0 123#81:00:12345678#112233",
        "(1.0) can0 12123#81:00:12345678#", "  can0  123  [0003]  11 22 33"}) {
    CandumpLine line;
    ASSERT_EQ(read_candump_line(text, line), CandumpError::none) << text;
    EXPECT_TRUE(line.frame.remote) << text;
    EXPECT_EQ(line.frame.size, 0) << text;
  }
  CandumpLine line;
  ASSERT_EQ(read_candump_line(" can0  244   {B}  01 02 03 04 05 06 07 08", line),
            CandumpError::none);
  EXPECT_EQ(bytes_of(line.frame), (std::vector<int>{1, 2, 3, 4, 5, 6, 7, 8}));
  for (const char* const text :
       {"(1.0) can0 123#81:00:1234567#112233", "(1.0) can0 123#81:00:12345678",
        "(1.0) can0 244#R8_B more", " can0  244   {8}  01 02 03 04 05 06 07 08"}) {
    EXPECT_NE(read_candump_line(text, line), CandumpError::none) << text;
  }
}

TEST(Candump, AcceptsTheChannelNamesOfPythonCan) {
  for (const char* const name : {"PCAN_USBBUS1", "239.74.163.2", "/dev/ttyACM0",
                                 "ff15:7079:7468:6f6e:6465:6d6f:6d63:6173"}) {
    CandumpLine line;
    const std::string text = std::string("(1436509052.249713) ") + name + " 244#00";
    ASSERT_EQ(read_candump_line(text, line), CandumpError::none) << name;
    EXPECT_EQ(line.interface, name);
  }
}

TEST(Candump, ReadsTimesToTheMicrosecond) {
  CandumpLine line;
  read_candump_line("(1436509052.249713) vcan0 244#", line);
  EXPECT_EQ(line.time_us, 1436509052249713U);
  EXPECT_EQ(line.time, "1436509052.249713");
  read_candump_line("(1436509052.249713999) vcan0 244#", line);
  EXPECT_EQ(line.time_us, 1436509052249713U);
  read_candump_line(" (001.5)  vcan0  244   [0]", line);
  EXPECT_EQ(line.time_us, 1500000U);
  EXPECT_FALSE(line.date);
  read_candump_line(" (2015-07-10 06:17:32.249713)  vcan0  244   [0]", line);
  EXPECT_EQ(line.time_us, 1436509052249713U);
  EXPECT_TRUE(line.date);
  read_candump_line("  vcan0  244   [0]", line);
  EXPECT_FALSE(line.time_us);
}

TEST(Candump, ReportsTheErrorInALine) {
  using E = CandumpError;
  for (const auto& [text, error] : std::vector<std::pair<std::string, CandumpError>>{
           {"H:ROS2-R4;T:79201;^0xf390d9ad^", E::no_frame},
           {"DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 3)", E::dropped},
           {"vcan0", E::no_frame},
           {"vcan0 244", E::no_frame},
           {"  vcan0  TX B E 244 4 00", E::no_frame},
           {"  vcan0  TX what", E::no_frame},
           {"(1436509052", E::cut},
           {"(1436509052.249713)", E::cut},
           {"(1436509052.249713) vca", E::cut},
           {"(1436509052.249713) vcan0 24", E::cut},
           {"(1436509052.249713) vcan0 244#2", E::cut},
           {"(1436509052.249713) vcan0 244##", E::cut},
           {"  vcan0  244   [4]  2A 36 6", E::cut},
           {"  vcan0  244   [4]  2A 36", E::cut},
           {"(yesterday) vcan0 244#", E::time},
           {"(1436509052) vcan0 244#", E::time},
           {"(-1.5) vcan0 244#", E::time},
           {"(1.1234567890) vcan0 244#", E::time},
           {"(99999999999999999999.5) vcan0 244#", E::time},
           {"(2015-02-30 08:57:32.249713) vcan0 244#", E::time},
           {"(1.0) " + std::string(65, 'x') + " 244#", E::interface},
           {"(1.0) vc\xffn0 244#", E::interface},
           {"(1.0) vcan0 24#", E::id},
           {"(1.0) vcan0 800#", E::id},
           {"(1.0) vcan0 2x4#", E::id},
           {"(1.0) vcan0 40000000#", E::id},
           {"  vcan0  1244   [0]", E::id},
           {"(1.0) vcan0 244#0102030405060708FF", E::size},
           {"(1.0) vcan0 244##1010203040506070809", E::size},
           {"(1.0) vcan0 244##1" + std::string(1000, '0'), E::size},
           {"  vcan0  244   [9]  00 00 00 00 00 00 00 00 00", E::size},
           {"  vcan0  244   [x]  00", E::size},
           {"  vcan0  244  [99]  00", E::size},
           {"(1.0) vcan0 244#0x", E::bytes},
           {"(1.0) vcan0 244##x", E::bytes},
           {"  vcan0  244   [1]  0x", E::bytes},
           {"(1.0) vcan0 244#00 and more", E::rest},
           {"(1.0) vcan0 244#Rest", E::rest},
           {"  vcan0  244   [1]  00 01", E::rest},
       }) {
    CandumpLine line;
    EXPECT_STREQ(to_text(read_candump_line(text, line)), to_text(error)) << text;
  }
}

TEST(Candump, AcceptsAnyBytesWithoutCrashing) {
  std::mt19937 random(4);
  const std::string whole = "(1436509052.249713)  vcan0  TX B -  244##1 [12] 2A 36 ' remote";
  for (int i = 0; i < 200000; ++i) {
    std::string text = whole.substr(random() % whole.size(), random() % whole.size());
    for (auto n = random() % 4; n != 0 && !text.empty(); --n) {
      text[random() % text.size()] = static_cast<char>(random());
    }
    // An exact copy, so that a sanitizer finds a read beyond its end.
    const std::vector<char> exact(text.begin(), text.end());
    CandumpLine line;
    if (read_candump_line({exact.data(), exact.size()}, line) == CandumpError::none) {
      EXPECT_TRUE(has_valid_size(line.frame)) << text;
    }
  }
}

}  // namespace
}  // namespace r4::tool
