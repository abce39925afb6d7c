// SPDX-License-Identifier: GPL-3.0-or-later
// MCAP of a recording, and back. Its checksums and indexes: tests/integration/test_convert.py.
#include <gtest/gtest.h>

#include "converted.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

TEST(Mcap, GivesTheRecordingBackByteByByte) {
  for (const std::string& native :
       {recorded_capture(), generated_recording(4, 5000), generated_recording(2, 100'000)}) {
    const std::string mcap = converted(native, ".r4log", ".mcap").bytes;
    for (const std::size_t piece : {7, 4096, 10'000'000}) {
      if (piece < mcap.size() / 100'000) continue;
      const Converted back = converted(mcap, ".mcap", ".r4log", piece);
      EXPECT_EQ(back.bytes, native) << piece;
      EXPECT_TRUE(back.damage.empty());
    }
  }
}

TEST(Mcap, GoesOnWithTheNextChunkBehindDamage) {
  const std::string native = generated_recording(5, 12'000);
  const std::string mcap = converted(native, ".r4log", ".mcap").bytes;
  const auto chunk = [&mcap](int n) {
    std::size_t at = 0;
    for (int i = 0; i <= n; ++i) at = mcap.find(std::string("\x04\0\0\0zstd", 8), at + 1);
    return at - 37;
  };
  const std::size_t second = chunk(1);
  const std::size_t third = chunk(2);
  ASSERT_LT(third, mcap.size());
  // In the record's head, its sizes, its checksum, and what is compressed.
  for (const std::size_t at :
       {second, second + 4, second + 27, second + 34, second + 50, (second + third) / 2}) {
    std::string damaged = mcap;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x55);
    const Converted back = converted(damaged, ".mcap", ".r4log");
    ASSERT_EQ(back.damage.size(), 1) << at - second;
    EXPECT_EQ(back.damage[0].offset, second) << at - second;
    const std::size_t beginning = native.size() / 5;
    EXPECT_EQ(back.bytes.substr(0, beginning), native.substr(0, beginning));
    EXPECT_TRUE(back.bytes.ends_with(native.substr(native.size() - 50'000))) << at - second;
  }
}

TEST(Mcap, ReadsTheWholeChunksOfATornFile) {
  const std::string native = generated_recording(6, 6000);
  const std::string mcap = converted(native, ".r4log", ".mcap").bytes;
  const Converted back = converted(mcap.substr(0, mcap.size() * 3 / 4), ".mcap", ".r4log");
  ASSERT_EQ(back.damage.size(), 1);
  EXPECT_TRUE(contains(back.damage[0].reason, "not whole"));
  EXPECT_GT(back.bytes.size(), native.size() / 4);
  EXPECT_TRUE(native.starts_with(back.bytes));
}

TEST(Mcap, NamesATopicByTheBoardFromTheBeginning) {
  std::string native;
  write_record_header(native);
  write_wire(native, {1, "udp://a", ""});
  write_wire(native, {2, "serial:b", ""});
  write_wire(native, {3, "udp://c", ""});
  for (std::uint16_t wire = 1; wire <= 3; ++wire) {
    write_record(native, {Time{5}, wire, RecordKind::event, "up"});
  }
  write_wire(native, {1, "udp://a", "arm"});
  write_wire(native, {2, "serial:b", "arm"});
  write_record(native, {Time{6}, 1, RecordKind::event, "up"});
  const std::string mcap = converted(native, ".r4log", ".mcap").bytes;
  // Channels are repeated behind the data: id, schema, topic.
  for (const std::string topic : {"/arm", "/arm_2", "/board3", "/r4log"}) {
    EXPECT_NE(mcap.find(static_cast<char>(topic.size()) + std::string(3, '\0') + topic),
              std::string::npos)
        << topic;
  }
  EXPECT_EQ(mcap.find("/board1"), std::string::npos);
}

TEST(Mcap, RefusesWhatItCannotReadOrHold) {
  for (const std::string& file : {std::string(), std::string("\x89MCAP"), std::string(100, 'x'),
                                  std::string("\x89MCAP0\r\n") + std::string(50, '\xFF')}) {
    EXPECT_EQ(problem_of([&] { converted(file, ".mcap", ".r4log"); }).reason, "no MCAP file");
  }
  const std::string foreign =
      std::string("\x89MCAP0\r\n\x01\x08\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0", 25);
  EXPECT_TRUE(contains(problem_of([&] { converted(foreign, ".mcap", ".r4log"); }).reason,
                       "no recording of r4"));
  std::string late;
  write_record_header(late);
  write_record(late, {Time{18'446'744'073'709'552}, 1, RecordKind::event, "x"});
  EXPECT_TRUE(contains(problem_of([&] { converted(late, ".r4log", ".mcap"); }).reason, "2554"));
}

}  // namespace
}  // namespace r4::test
