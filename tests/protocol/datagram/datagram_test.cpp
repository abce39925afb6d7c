// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/datagram.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/support/datagrams.hpp"

namespace r4 {
namespace {

using test::captured_state;
using test::str;
using test::with_crc;

ReadResult read_of(const std::string& bytes) {
  Datagram datagram;
  return read_datagram(bytes, datagram);
}

std::vector<std::string> fields_of(const Datagram& datagram) {
  std::vector<std::string> fields;
  for (const Field& field : datagram)
    fields.push_back(str(field.name()) + ':' + str(field.values()));
  return fields;
}

std::vector<std::string> values_of(const Field& field) {
  std::vector<Text> values(field.count());
  EXPECT_EQ(field.split(values.data(), values.size()), values.size());
  std::vector<std::string> strings;
  for (const Text value : values) strings.push_back(str(value));
  return strings;
}

TEST(Datagram, GivesItsFieldsInTheirOrder) {
  const std::string bytes = with_crc("T:5;A:;B:1,,2;PNum:9;C:x:y z;");
  Datagram datagram;
  ASSERT_TRUE(read_datagram(bytes, datagram));
  EXPECT_EQ(fields_of(datagram),
            (std::vector<std::string>{"T:5", "A:", "B:1,,2", "PNum:9", "C:x:y z"}));
  EXPECT_EQ(datagram.pnum(), 9U);
  EXPECT_EQ(datagram.time_ms(), 5U);
  EXPECT_EQ(str(datagram.find("B").values()), "1,,2");
  EXPECT_TRUE(datagram.find("D").name().empty());
  EXPECT_TRUE(datagram.find("D").values().empty());
  EXPECT_EQ(datagram.bytes().data(), bytes.data()) << "a view, not a copy";
}

TEST(Datagram, ValuesAreSplitAtCommas) {
  EXPECT_EQ(values_of(Field("A", "1,,2")), (std::vector<std::string>{"1", "", "2"}));
  EXPECT_EQ(values_of(Field("A", "")), (std::vector<std::string>{""}));
  EXPECT_EQ(values_of(Field("A", ",")), (std::vector<std::string>{"", ""}));
  EXPECT_EQ(values_of(Field()), (std::vector<std::string>{""}));
  Text first;
  EXPECT_EQ(Field("A", "x,y,z").split(&first, 1), 3U);
  EXPECT_EQ(str(first), "x");
}

TEST(Datagram, AcceptsAnyLineTerminatorOrNone) {
  const std::string bytes = captured_state();
  for (const std::string end : {"", "\r", "\n", "\r\n"}) {
    const std::string line = bytes + end;
    Datagram datagram;
    ASSERT_TRUE(read_datagram(line, datagram));
    EXPECT_EQ(str(datagram.bytes()), bytes);
  }
  EXPECT_EQ(read_of(bytes + "\n\r").error, ReadError::syntax);
  EXPECT_EQ(read_of(bytes + "\n\n").error, ReadError::syntax);
}

TEST(Datagram, AcceptsLeadingZerosAndCapitalsInTheChecksum) {
  const std::string fields = "O:1,0,1;PNum:67;T:1699276044483;";  // its CRC has seven digits
  for (const std::string crc : {"a13d0ac", "0a13d0ac", "A13D0AC", "0A13d0aC"}) {
    EXPECT_TRUE(read_of(fields + "^0x" + crc + "^")) << crc;
  }
  EXPECT_EQ(read_of(fields + "^0x00a13d0ac^").error, ReadError::syntax);
}

TEST(Datagram, ReportsALineOfTheWrongLength) {
  for (const std::string nothing : {"", "\r", "\n", "\r\n"}) {
    EXPECT_EQ(read_of(nothing).error, ReadError::length);
    EXPECT_EQ(read_of(nothing).position, 0U);
  }
  std::string fields = "A:" + std::string(1100, 'x') + ';';
  std::string bytes = with_crc(fields);
  fields.erase(2, bytes.size() - max_datagram);
  bytes = with_crc(fields);
  while (bytes.size() < max_datagram) {  // a checksum with a leading zero is shorter
    fields.insert(2, "x");
    bytes = with_crc(fields);
  }
  ASSERT_EQ(bytes.size(), max_datagram);
  EXPECT_TRUE(read_of(bytes));
  EXPECT_TRUE(read_of(bytes + "\r\n")) << "the terminator does not count to the length";
  fields.insert(2, "x");
  const ReadResult result = read_of(with_crc(fields));
  EXPECT_EQ(result.error, ReadError::length);
  EXPECT_EQ(result.position, max_datagram);
}

TEST(Datagram, ReportsADamagedTrailer) {
  struct Case {
    const char* bytes;
    std::size_t position;
  };
  for (const Case& c : {Case{"A:1;", 4}, Case{"A:1;^", 5}, Case{"A:1;^0", 6}, Case{"A:1;^0x", 7},
                        Case{"A:1;^0x^", 7}, Case{"A:1;^1x0^", 5}, Case{"A:1;^0X0^", 6},
                        Case{"A:1;^0xg^", 7}, Case{"A:1;^0x123456789^", 7}, Case{"A:1;^0x12", 9},
                        Case{"A:1;^0x12^ ", 10}, Case{"A:1;^0x12^^", 10}, Case{"^^", 1}}) {
    const ReadResult result = read_of(c.bytes);
    EXPECT_EQ(result.error, ReadError::syntax) << c.bytes;
    EXPECT_EQ(result.position, c.position) << c.bytes;
  }
}

TEST(Datagram, ReportsTheExpectedAndTheWrongChecksum) {
  const ReadResult result = read_of("H:ROS2-R4;T:79201;^0xf390d9ae^");
  EXPECT_EQ(result.error, ReadError::crc);
  EXPECT_EQ(result.position, 21U);
  EXPECT_EQ(result.crc_expected, 0xF390D9ADU);
  EXPECT_EQ(result.crc_found, 0xF390D9AEU);
  EXPECT_FALSE(result);
}

TEST(Datagram, ReportsThePositionOfAnInvalidField) {
  struct Case {
    std::string fields;
    std::size_t position;
  };
  for (const Case& c : {Case{"", 0},        Case{";", 0},
                        Case{":;", 0},      Case{":1;", 0},
                        Case{"A;", 1},      Case{"A", 1},
                        Case{"A:", 2},      Case{"A:1", 3},
                        Case{"A:1;;", 4},   Case{"A:1;B", 5},
                        Case{"A:1;B:", 6},  Case{"A B:1;", 1},
                        Case{"A,B:1;", 1},  Case{"A:1\t;", 3},
                        Case{"A:\x7F;", 2}, Case{"A:\xC3\xA9;", 2},
                        Case{"\xC3:1;", 0}, Case{std::string("A:\0;", 4), 2},
                        Case{"A:1\r;", 3},  Case{"A:1\n;B:2;", 3}}) {
    const ReadResult result = read_of(with_crc(c.fields));
    EXPECT_EQ(result.error, ReadError::syntax) << c.fields;
    EXPECT_EQ(result.position, c.position) << c.fields;
  }
}

TEST(Datagram, ChecksLengthThenTrailerThenChecksumThenFields) {
  EXPECT_EQ(read_of(std::string(max_datagram + 1, 'x')).error, ReadError::length);
  EXPECT_EQ(read_of("A B;^0x1").error, ReadError::syntax);
  EXPECT_EQ(read_of("A B;^0x1^").error, ReadError::crc);
  EXPECT_EQ(read_of(with_crc("A B;")).error, ReadError::syntax);
}

TEST(Datagram, PacketNumberAndTimeAreWholeNumbersAndOccurOnce) {
  Datagram datagram;
  const std::string neither = with_crc("A:1;");
  ASSERT_TRUE(read_datagram(neither, datagram));
  EXPECT_FALSE(datagram.has_pnum());
  EXPECT_FALSE(datagram.has_time());
  const std::string largest = with_crc("PNum:4294967295;T:18446744073709551615;");
  ASSERT_TRUE(read_datagram(largest, datagram));
  EXPECT_TRUE(datagram.has_pnum());
  EXPECT_EQ(datagram.pnum(), 4294967295U);
  EXPECT_TRUE(datagram.has_time());
  EXPECT_EQ(datagram.time_ms(), 18446744073709551615U);
  for (const char* fields :
       {"PNum:4294967296;", "PNum:-1;", "PNum:;", "PNum:1,2;", "PNum: 1;", "PNum:+1;", "PNum:x;",
        "T:18446744073709551616;", "T:-1;", "T:;", "T:1,2;", "T:1.5;"}) {
    const ReadResult result = read_of(with_crc(fields));
    EXPECT_EQ(result.error, ReadError::syntax) << fields;
    EXPECT_EQ(result.position, std::string(fields).find(':') + 1) << fields;
  }
  EXPECT_EQ(read_of(with_crc("PNum:1;PNum:1;")).position, 7U);
  EXPECT_EQ(read_of(with_crc("T:1;A:2;T:1;")).position, 8U);
}

TEST(Datagram, OnlyPNumAndTNameThePacketNumberAndTheTime) {
  const std::string bytes = with_crc("pnum:x;t:x;PNUM:x;PNumber:x;TT:x;");
  Datagram datagram;
  ASSERT_TRUE(read_datagram(bytes, datagram));
  EXPECT_FALSE(datagram.has_pnum());
  EXPECT_FALSE(datagram.has_time());
}

TEST(Datagram, ARefusedLineLeavesTheResultUnchanged) {
  const std::string good = with_crc("O:358,1,1;PNum:1;");
  std::string damaged = with_crc("O:100,1,2;PNum:2;");
  damaged[2] = '9';
  for (const std::string& refused :
       {std::string(), std::string(2000, 'O'), std::string("O:100,1,2;PNum:2;"), damaged,
        with_crc("O:100,1,2;PNum"), with_crc("O:100,1,2;PNum:2;PNum:2;"),
        with_crc("O:100,1,2;PNum:2;SID:0;"), with_crc("O:100,1,2;PNum:2;T:x;")}) {
    Datagram datagram;
    ASSERT_TRUE(read_datagram(good, datagram));
    EXPECT_FALSE(read_datagram(refused, datagram)) << refused;
    EXPECT_EQ(str(datagram.bytes()), good) << refused;
    EXPECT_EQ(str(datagram.command().values()), "358,1,1") << refused;
    EXPECT_EQ(fields_of(datagram), (std::vector<std::string>{"O:358,1,1", "PNum:1"})) << refused;
    EXPECT_EQ(datagram.pnum(), 1U) << refused;
  }
}

TEST(Datagram, ReadsASingleFieldFromText) {
  Field field;
  ASSERT_TRUE(read_field("O:358,1,1", field));
  EXPECT_EQ(str(field.name()), "O");
  EXPECT_EQ(str(field.values()), "358,1,1");
  ASSERT_TRUE(read_field("E:", field));
  EXPECT_EQ(str(field.values()), "");
  for (const std::string text : {"", "O", ":1", "O 1:2", "O:1;", "O:1^", "O:1\n", "O,P:1"}) {
    Field untouched("X", "y");
    EXPECT_FALSE(read_field(text, untouched)) << text;
    EXPECT_EQ(str(untouched.name()), "X") << text;
  }
}

TEST(Datagram, EveryReadErrorHasAText) {
  EXPECT_STREQ(to_text(ReadError::none), "");
  EXPECT_STREQ(to_text(ReadError::length), "length");
  EXPECT_STREQ(to_text(ReadError::syntax), "syntax");
  EXPECT_STREQ(to_text(ReadError::crc), "crc");
}

TEST(Datagram, ReadsTheSessionIdAtAnyPosition) {
  for (const char* fields :
       {"SID:0123456789abcdef;H:ROS2-R4;PNum:1;T:2;", "H:ROS2-R4;SID:0123456789abcdef;PNum:1;T:2;",
        "H:ROS2-R4;PNum:1;T:2;SID:0123456789abcdef;"}) {
    const std::string bytes = test::with_crc(fields);
    Datagram datagram;
    ASSERT_TRUE(read_datagram(bytes, datagram)) << fields;
    EXPECT_EQ(datagram.session_id(), 0x0123456789abcdefU);
    EXPECT_EQ(datagram.command().name(), "H");
    const Datagram copied = datagram;
    EXPECT_EQ(copied.session_id(), 0x0123456789abcdefU);
  }
  const std::string none = test::with_crc("CMD:5;PNum:1;T:2;");
  Datagram datagram;
  ASSERT_TRUE(read_datagram(none, datagram));
  EXPECT_EQ(datagram.session_id(), no_session);
}

TEST(Datagram, RefusesAnInvalidSessionId) {
  for (const char* id :
       {"", "0", "0000000000000000", "0123456789abcde", "0123456789abcdef0", "0123456789abcdeg",
        "01234567,9abcdef", "0x23456789abcdef", "0123456789ABCDEF"}) {
    const std::string bytes = test::with_crc("H:ROS2-R4;SID:" + std::string(id) + ";PNum:1;T:2;");
    Datagram datagram;
    const ReadResult result = read_datagram(bytes, datagram);
    EXPECT_EQ(result.error, ReadError::syntax) << id;
    EXPECT_EQ(result.position, 14U);
  }
  const std::string twice = test::with_crc("SID:0123456789abcdef;SID:0123456789abcdef;PNum:1;T:2;");
  Datagram datagram;
  EXPECT_EQ(read_datagram(twice, datagram).error, ReadError::syntax);
}

}  // namespace
}  // namespace r4
