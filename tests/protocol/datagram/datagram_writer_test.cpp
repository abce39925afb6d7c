// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/messages/datagram_writer.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "r4link/datagram.hpp"
#include "tests/support/datagrams.hpp"

namespace r4 {
namespace {

using test::str;
using test::with_crc;

TEST(DatagramWriter, WritesTheCommandOfThePaper) {
  char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  writer.field("O").value(358).value(1).value(1);
  EXPECT_EQ(str(writer.finish(66, 1699276044383U)),
            "O:358,1,1;PNum:66;T:1699276044383;^0x7fefae81^");
  EXPECT_TRUE(writer.ok());
}

TEST(DatagramWriter, TheChecksumHasNoLeadingZeros) {
  char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  writer.field("O").value(1).value(0).value(1);
  EXPECT_EQ(str(writer.finish(67, 1699276044483U)), "O:1,0,1;PNum:67;T:1699276044483;^0xa13d0ac^");
}

TEST(DatagramWriter, WritesEveryKindOfValue) {
  char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  writer.field("A").value("text").value("").value(std::numeric_limits<std::int32_t>::min());
  writer.field("B").value(4294967295U).value(std::numeric_limits<std::uint64_t>::max());
  writer.field("C").hundredths(-5).hundredths(2428);
  writer.field("D").values("a,b").values("c,,d");
  writer.field("E");
  writer.field("F").value("");
  writer.field("G").value("").value("");
  EXPECT_EQ(str(writer.finish()),
            with_crc("A:text,,-2147483648;B:4294967295,18446744073709551615;C:-0.05,24.28;"
                     "D:a,b,c,,d;E:;F:;G:,;"));
}

TEST(DatagramWriter, ConstantFieldNamesAreWrittenTheSame) {
  constexpr FieldName one("A");
  constexpr FieldName ten("TENLETTERS");
  static_assert(one.allowed() && ten.allowed());
  static_assert(!FieldName("A;B").allowed() && !FieldName("A B").allowed() &&
                !FieldName("A:").allowed() && !FieldName("\x7F").allowed() &&
                !FieldName("").allowed());
  EXPECT_EQ(str(ten.name()), "TENLETTERS");
  // The buffers have every size, including sizes that are too small for the copy of fixed size.
  for (std::size_t capacity = 0; capacity <= 64; ++capacity) {
    const auto write = [&](const auto& first, const auto& second) {
      std::string buffer(capacity + 32, '#');
      DatagramWriter writer(&buffer[0], capacity);
      writer.field(first).value(1).field(second).value(2).field(first);
      const std::string written = str(writer.finish());
      EXPECT_EQ(buffer.substr(capacity), std::string(32, '#')) << capacity;
      return written;
    };
    EXPECT_EQ(write(one, ten), write(one.name(), ten.name())) << capacity;
  }
}

TEST(DatagramWriter, NoValueCanForgeAField) {
  const std::string forgeries[] = {"1;E:STOP", "1^",   "1\r",   "1\n", std::string("1\0", 2),
                                   "\x7F",     "\x80", "\xC3²", "\t"};
  for (const std::string& text : forgeries) {
    char buffer[max_datagram];
    DatagramWriter as_value(buffer, sizeof buffer);
    as_value.field("A").value(text);
    EXPECT_FALSE(as_value.ok()) << text;
    EXPECT_TRUE(as_value.finish(1, 2).empty()) << text;
    DatagramWriter as_values(buffer, sizeof buffer);
    as_values.field("A").values(text);
    EXPECT_TRUE(as_values.finish(1, 2).empty()) << text;
    DatagramWriter as_name(buffer, sizeof buffer);
    as_name.field(text).value(1);
    EXPECT_TRUE(as_name.finish(1, 2).empty()) << text;
  }
  for (const std::string name : {"", "A:B", "A B", "A,B", " "}) {
    char buffer[max_datagram];
    DatagramWriter writer(buffer, sizeof buffer);
    writer.field(name).value(1);
    EXPECT_TRUE(writer.finish(1, 2).empty()) << name;
  }
  char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  writer.field("A").value("1,2");
  EXPECT_TRUE(writer.finish(1, 2).empty()) << "a comma would split the value into two";
}

TEST(DatagramWriter, AnInvalidValueFailsTheWholeDatagram) {
  char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  writer.field("A").value("bad;").field("B").value(1).hundredths(2).values("c");
  EXPECT_FALSE(writer.ok());
  EXPECT_EQ(writer.size(), 2U);
  EXPECT_TRUE(writer.finish().empty());
}

TEST(DatagramWriter, AValueNeedsAField) {
  char buffer[max_datagram];
  DatagramWriter number(buffer, sizeof buffer);
  number.value(1);
  EXPECT_TRUE(number.finish(1, 2).empty());
  DatagramWriter text(buffer, sizeof buffer);
  text.value("a");
  EXPECT_TRUE(text.finish(1, 2).empty());
}

TEST(DatagramWriter, ADatagramNeedsAField) {
  char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  EXPECT_TRUE(writer.finish().empty());
  DatagramWriter with_numbers(buffer, sizeof buffer);
  EXPECT_EQ(str(with_numbers.finish(1, 2)), with_crc("PNum:1;T:2;"));
}

TEST(DatagramWriter, CanBeFinishedOnlyOnce) {
  char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  writer.field("A").value(1);
  EXPECT_FALSE(writer.finish().empty());
  EXPECT_TRUE(writer.finish().empty());
}

// In a buffer of every size, finish() writes the whole datagram or nothing, and no byte after the
// buffer.
TEST(DatagramWriter, RefusesADatagramThatDoesNotFit) {
  const auto write = [](char* buffer, std::size_t capacity) {
    DatagramWriter writer(buffer, capacity);
    writer.field("OSMC1").value(400).value(1).field("AIN24").hundredths(2428);
    writer.field("NAME").value("text").values("a,b");
    return str(writer.finish(4294967295U, 18446744073709551615U));
  };
  char roomy[max_datagram];
  const std::string whole = write(roomy, sizeof roomy);
  ASSERT_FALSE(whole.empty());
  for (std::size_t capacity = 0; capacity < whole.size() + 4; ++capacity) {
    std::string buffer(capacity + 32, '#');
    const std::string written = write(&buffer[0], capacity);
    EXPECT_EQ(written, capacity < whole.size() ? "" : whole) << capacity;
    EXPECT_EQ(buffer.substr(capacity), std::string(32, '#'))
        << "written after the end of a buffer of " << capacity;
  }
}

TEST(DatagramWriter, TheTrailerFitsItsMaximumSize) {
  for (int i = 0; i < 64; ++i) {  // some of these checksums have all eight digits
    char buffer[max_datagram];
    DatagramWriter writer(buffer, sizeof buffer);
    writer.field("A").value(i);
    const std::size_t before = writer.size();
    const Text datagram = writer.finish(4294967295U, 18446744073709551615U);
    EXPECT_LE(datagram.size() - before, DatagramWriter::trailer_max);
  }
}

TEST(DatagramWriter, NoDatagramIsLongerThanTheLimit) {
  char buffer[2 * max_datagram];
  std::size_t longest = 0;
  for (std::size_t size = 900; size < 1100; ++size) {
    DatagramWriter writer(buffer, sizeof buffer);
    writer.field("A").value(std::string(size, 'x'));
    const Text written = writer.finish();
    if (written.size() > longest) longest = written.size();
    Datagram datagram;
    EXPECT_TRUE(written.empty() || read_datagram(written, datagram)) << size;
  }
  EXPECT_GE(longest, max_datagram - 1);
  EXPECT_LE(longest, max_datagram);
}

TEST(DatagramWriter, AFieldThatIsTooLongCanBeRemoved) {
  char buffer[32];
  DatagramWriter writer(buffer, sizeof buffer);
  writer.field("A").value(1).value(2);
  const std::size_t before = writer.size();
  writer.field("B").value(std::string(100, 'x'));
  EXPECT_FALSE(writer.ok());
  writer.truncate(before);
  EXPECT_TRUE(writer.ok());
  writer.field("C").value(3);
  EXPECT_EQ(str(writer.finish()), with_crc("A:1,2;C:3;"));
}

TEST(DatagramWriter, RemovingEverythingAllowsANewDatagram) {
  char buffer[64];
  DatagramWriter writer(buffer, sizeof buffer);
  writer.field("A").value(1);
  writer.truncate(0);
  writer.field("B").value(2);
  EXPECT_EQ(str(writer.finish()), with_crc("B:2;"));
}

}  // namespace
}  // namespace r4
