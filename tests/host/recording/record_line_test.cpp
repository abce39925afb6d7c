// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/recordings/record_line.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <string>

#include "tests/support/datagrams.hpp"

namespace r4 {
namespace {

const Time sample{1795468293404765};

std::string line_of(const Record& record) {
  std::string line;
  write_record(line, record);
  EXPECT_EQ(line.back(), '\n');
  line.pop_back();
  return line;
}

TEST(RecordLine, HasTimePathDirectionAndTheUnchangedDatagram) {
  EXPECT_EQ(line_of({sample, 1, RecordKind::from_board, "AIN24:24.28;PNum:1;T:2;^0xf07cfd9a^"}),
            "1795468293.404765 1< AIN24:24.28;PNum:1;T:2;^0xf07cfd9a^");
  EXPECT_EQ(line_of({Time{5}, 12, RecordKind::to_board, ""}), "0.000005 12> ");
  EXPECT_EQ(line_of({sample, 0, RecordKind::event, "end"}), "1795468293.404765 0! end");
  EXPECT_EQ(record_time_text(sample), "2026-11-23T21:11:33.404765Z");
}

RC_GTEST_PROP(RecordLine, TimesAreReadBackFromTheirText, ()) {
  const Time time{*rc::gen::inRange<std::int64_t>(0, 253402300799999999)};
  const std::string text = record_time_text(time);
  RC_ASSERT(read_record_time(text) == time);
  // The shortest form, to the second.
  RC_ASSERT(read_record_time(text.substr(0, 19)) == std::chrono::floor<std::chrono::seconds>(time));
}

TEST(RecordLine, RejectsATextThatIsNotATime) {
  EXPECT_EQ(read_record_time("2026-11-23T21:11:33.4"), Time{1795468293400000});
  for (const char* const text :
       {"", "Z", "2026-11-23", "2026-11-23T21:11", "2026-11-23T21:11:33.", "2026-11-23T21:11:33ZZ",
        "2026-11-23T21:11:33.4047655", "2026-11-23T21:11:33+01", "2026-11-23 21:11:33",
        "2026-02-29T21:11:33", "2026-13-01T21:11:33", "2026-11-23T24:00:00", "2026-11-23T21:60:00",
        "1969-12-31T23:59:59", "2026-11-23T21:11:-1", "x026-11-23T21:11:33"}) {
    EXPECT_FALSE(read_record_time(text)) << text;
  }
}

TEST(RecordLine, ForAStateHasAtMostTwoHundredBytes) {
  // A state after a day, with the paper's fields and the fields for a host in control.
  const std::string state =
      "AIN24:24.56;AIN12:12.15;AIN5:5.11;AINDMH:12.16;DMHSTA:1;AINSTEER:0.95;DHB1A:4095,1;"
      "OSMC1:358,1;STEP1POS:-100;SERVO1POS:2000;CMD:2541659426;PNum:8640000;T:86400000;^"
      "0x36f0e204^";
  EXPECT_LE(line_of({sample, 1, RecordKind::from_board, state}).size() + 1, 200);
}

RC_GTEST_PROP(RecordLine, GivesAnyBytesBack, (const std::string& bytes, std::uint16_t path)) {
  const auto kind =
      *rc::gen::element(RecordKind::from_board, RecordKind::to_board, RecordKind::event);
  const Time time{*rc::gen::inRange<std::int64_t>(0, 253402300799999999)};
  const std::string line = line_of({time, path, kind, bytes});
  for (const char c : line) RC_ASSERT(c >= ' ' && c <= '~');
  RecordLine read;
  RC_ASSERT(read_record_line(line, read));
  RC_ASSERT(read.kind == LineKind::record);
  RC_ASSERT(read.record.time == time);
  RC_ASSERT(read.record.path == path);
  RC_ASSERT(read.record.kind == kind);
  RC_ASSERT(read.record.bytes == bytes);
}

TEST(RecordLine, PreservesEveryByteOfTheLongestRecord) {
  std::string bytes;
  for (std::size_t i = 0; i < max_record_bytes; ++i) bytes += static_cast<char>(i * 7);
  const std::string line = line_of({sample, 65535, RecordKind::from_board, bytes + "more"});
  EXPECT_LE(line.size(), max_record_line);
  RecordLine read;
  ASSERT_TRUE(read_record_line(line, read));
  EXPECT_EQ(read.record.bytes, bytes) << "longer data must be cut";
}

TEST(RecordLine, RejectsALineThatIsNotARecordLine) {
  for (const char* const line : {
           "x",
           "1795468293.404765",
           "1795468293.404765 ",
           "1795468293.404765 1 x",
           "1795468293.404765 < x",
           "1795468293.404765 1? x",
           "1795468293.404765 65536< x",
           "1795468293.40476 1< x",
           "1795468293.4047650 1< x",
           "-1.000000 1< x",
           ".000000 1< x",
           "253402300800.000000 1< x",
           "1795468293.40476x 1< x",
           "1795468293.404765 1< a\\",
           "1795468293.404765 1< \\x1",
           "1795468293.404765 1< \\x1G",
           "1795468293.404765 1< \\xAB",
           "1795468293.404765 1< \x80",
           "# r4log",
           "# r4log x",
           "# r4log 99999999999 by r4",
           "# path 0 udp://x",
           "# path 65536 udp://x",
           "# path x",
       }) {
    RecordLine read;
    const bool good = read_record_line(line, read);
    EXPECT_TRUE(!good || read.kind == LineKind::comment) << line;
    if (!good) {
      EXPECT_STRNE(read.problem, "") << line;
    }
  }
}

TEST(RecordLine, ForAPathHasItsUrlAndAValidBoardName) {
  const std::string url = "udp:?id=a b\n\xff";
  for (const std::string& name :
       {std::string(), std::string("left-arm"), std::string("0042AF"),
        std::string("=1+cmd|calc!A0"), std::string("arm\x1b]0;owned\x07"), std::string("a b"),
        std::string("a/b"), std::string("\xff"), std::string(65, 'n')}) {
    std::string text;
    write_path(text, {7, url, name});
    text.pop_back();
    EXPECT_EQ(text.find('\n'), std::string::npos);
    RecordLine read;
    ASSERT_TRUE(read_record_line(text, read)) << text;
    EXPECT_EQ(read.kind, LineKind::path);
    EXPECT_EQ(read.path.number, 7);
    EXPECT_EQ(read.path.url, url);
    const bool valid = name == "left-arm" || name == "0042AF";
    EXPECT_EQ(read.path.name, valid ? name : "") << text;
  }
}

TEST(RecordLine, MasksSecretsInARecord) {
  const std::string setting = test::with_crc("C:password,letmein!;PNum:1;T:2;");
  const std::string masked = test::with_crc("C:password,...;PNum:1;T:2;");
  const struct {
    RecordKind kind;
    std::string bytes, kept;
  } cases[] = {
      {RecordKind::to_board, setting, masked},
      {RecordKind::from_board, setting, masked},  // a setting echoed by the board
      {RecordKind::event, "oversize noiseC:password,letmein!", "oversize noiseC:password,..."},
      {RecordKind::event, "up serial:///dev/pci-0000:0C:00.0,1",
       "up serial:///dev/pci-0000:0C:00.0,1"},
      {RecordKind::from_board, std::string(5000, 'x'), std::string(max_record_bytes, 'x')},
  };
  for (const auto& c : cases) {
    RecordRoom room;
    const Record kept = without_secrets(Record{sample, 3, c.kind, c.bytes}, room);
    EXPECT_EQ(kept.bytes, c.kept);
    EXPECT_EQ(kept.time, sample);
    EXPECT_EQ(kept.path, 3);
    EXPECT_EQ(kept.kind, c.kind);
  }
}

TEST(RecordLine, ForADeviceHasItsAddressSlotAndDescription) {
  std::string text;
  write_device(text, {3, "my one@0x28:1", "device mine\naddress 0x40\n# \\\xff\n"});
  EXPECT_EQ(text,
            "# device 3 my\\x20one@0x28:1 device mine\\x0aaddress 0x40\\x0a# \\x5c\\xff\\x0a\n");
  text.pop_back();
  RecordLine read;
  ASSERT_TRUE(read_record_line(text, read)) << text;
  EXPECT_EQ(read.kind, LineKind::device);
  EXPECT_EQ(read.device.path, 3);
  EXPECT_EQ(read.device.place, "my one@0x28:1");
  EXPECT_EQ(read.device.description, "device mine\naddress 0x40\n# \\\xff\n");
  text.clear();
  write_device(text, {65535, "mine@0x28:1", std::string(5000, '\n')});
  EXPECT_LE(text.size(), max_record_line);
  text.pop_back();
  ASSERT_TRUE(read_record_line(text, read));
  EXPECT_EQ(read.device.description, std::string(max_record_bytes, '\n'));

  ASSERT_TRUE(read_record_line("# device was changed at noon", read));
  EXPECT_EQ(read.kind, LineKind::comment) << "a comment of a person";
  for (const char* const line :
       {"# device 0 bno055@0x28:1 device x", "# device 1 a\\x1b[2J@0x28:1 device x",
        "# device 70000 x", "# device 1 x \\x2"}) {
    EXPECT_FALSE(read_record_line(line, read)) << line;
  }
}

}  // namespace
}  // namespace r4
