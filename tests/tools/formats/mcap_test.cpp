// SPDX-License-Identifier: GPL-3.0-or-later
// Conversion of a recording to MCAP, and back. tests/integration/test_convert.py tests the
// checksums and indexes.
#include "tools/r4/formats/mcap/mcap.hpp"

#include <gtest/gtest.h>
#include <lz4frame.h>

#include "converted.hpp"
#include "r4link/recordings/zstd_stream.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

TEST(Mcap, ContinuesWithTheNextChunkAfterDamage) {
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
  // Damage in the head of the record, its sizes, its checksum, and the compressed data.
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
  EXPECT_TRUE(contains(back.damage[0].reason, "incomplete"));
  EXPECT_GT(back.bytes.size(), native.size() / 4);
  EXPECT_TRUE(native.starts_with(back.bytes));
}

TEST(Mcap, NamesATopicByTheBoardFromTheBeginning) {
  std::string native;
  write_record_header(native);
  write_path(native, {1, "udp://a", ""});
  write_path(native, {2, "serial:b", ""});
  write_path(native, {3, "udp://c", ""});
  for (std::uint16_t path = 1; path <= 3; ++path) {
    write_record(native, {Time{5}, path, RecordKind::event, "up"});
  }
  write_path(native, {1, "udp://a", "arm"});
  write_path(native, {2, "serial:b", "arm"});
  write_record(native, {Time{6}, 1, RecordKind::event, "up"});
  const std::string mcap = converted(native, ".r4log", ".mcap").bytes;
  // The channels are repeated after the data: id, schema, topic.
  for (const std::string topic : {"/arm", "/arm_2", "/board3", "/r4log"}) {
    EXPECT_NE(mcap.find(static_cast<char>(topic.size()) + std::string(3, '\0') + topic),
              std::string::npos)
        << topic;
  }
  EXPECT_EQ(mcap.find("/board1"), std::string::npos);
}

TEST(Mcap, RefusesInvalidFilesAndTooLargeTimes) {
  for (const std::string& file : {std::string(), std::string("\x89MCAP"), std::string(100, 'x'),
                                  std::string("\x89MCAP0\r\n") + std::string(50, '\xFF')}) {
    EXPECT_EQ(problem_of([&] { converted(file, ".mcap", ".r4log"); }).reason,
              "is not an MCAP file");
  }
  const std::string foreign =
      std::string("\x89MCAP0\r\n\x01\x08\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0", 25);
  EXPECT_TRUE(contains(problem_of([&] { converted(foreign, ".mcap", ".r4log"); }).reason,
                       "not a recording of r4"));
  std::string late;
  write_record_header(late);
  write_record(late, {Time{18'446'744'073'709'552}, 1, RecordKind::event, "x"});
  EXPECT_TRUE(contains(problem_of([&] { converted(late, ".r4log", ".mcap"); }).reason, "2554"));
}

using tool::append_number;
using tool::mcap::Fields;
using tool::mcap::Op;

// The schemas, channels and messages in a file of McapSink, as records.
struct McapRecord {
  Op op;
  std::string content;
};

std::vector<McapRecord> records_of(std::string_view bytes) {
  std::vector<McapRecord> records;
  Fields fields(bytes);
  while (!fields.rest().empty()) {
    const auto op = static_cast<Op>(fields.number<std::uint8_t>());
    const std::string_view content = fields.take(fields.number<std::uint64_t>());
    if (op == Op::data_end) break;
    if (op != Op::chunk) {
      if (op == Op::schema || op == Op::channel || op == Op::message) {
        records.push_back({op, std::string(content)});
      }
      continue;
    }
    Fields chunk(content.substr(28));
    chunk.string();
    std::string_view packed = chunk.take(chunk.number<std::uint64_t>());
    std::string text;
    ZstdReader reader;
    while (reader.step(packed) == ZstdReader::Step::text) text += reader.text();
    for (McapRecord& each : records_of(text)) records.push_back(std::move(each));
  }
  return records;
}

std::vector<McapRecord> records_in(const std::string& mcap) {
  return records_of(std::string_view(mcap).substr(tool::mcap::magic.size()));
}

std::string mcap_file(const std::string& profile, const std::string& data) {
  std::string head, file(tool::mcap::magic);
  tool::mcap::append_string(head, profile);
  tool::mcap::append_string(head, "another tool");
  tool::mcap::append_record(file, Op::header, head);
  file += data;
  tool::mcap::append_record(file, Op::data_end, std::string(4, '\0'));
  tool::mcap::append_record(file, Op::footer, std::string(20, '\0'));
  return file + std::string(tool::mcap::magic);
}

std::string as_records(const std::vector<McapRecord>& records) {
  std::string bytes;
  for (const McapRecord& each : records) tool::mcap::append_record(bytes, each.op, each.content);
  return bytes;
}

std::string as_chunk(const std::string& records, const std::string& compression) {
  std::string packed = records;
  if (compression == "lz4") {
    packed.resize(LZ4F_compressFrameBound(records.size(), nullptr));
    packed.resize(
        LZ4F_compressFrame(packed.data(), packed.size(), records.data(), records.size(), nullptr));
  }
  std::string content(16, '\0'), bytes;
  append_number(content, std::uint64_t{records.size()});
  append_number(content, std::uint32_t{0});  // no checksum
  tool::mcap::append_string(content, compression);
  append_number(content, std::uint64_t{packed.size()});
  tool::mcap::append_record(bytes, Op::chunk, content + packed);
  return bytes;
}

TEST(Mcap, ReadsFilesRewrittenByOtherTools) {
  const std::string native = generated_recording(8, 30'000);
  const std::string records = as_records(records_in(converted(native, ".r4log", ".mcap").bytes));
  ASSERT_GT(records.size(), 4 << 20);
  for (const std::string& data : {records, as_chunk(records, ""), as_chunk(records, "lz4"),
                                  as_chunk(records, "lz4") + as_chunk("", "lz4")}) {
    const Converted read = converted(mcap_file("", data), ".mcap", ".r4log", 100'000);
    EXPECT_EQ(read.bytes, native);
    EXPECT_TRUE(read.damage.empty());
  }
}

TEST(Mcap, ReportsADamagedLz4ChunkAndReadsTheNext) {
  const std::string native = recorded_capture();
  const std::string whole =
      as_chunk(as_records(records_in(converted(native, ".r4log", ".mcap").bytes)), "lz4");
  for (std::size_t at = 46; at < whole.size(); at += 97) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x55);
    const Converted read = converted(mcap_file("", damaged + whole), ".mcap", ".r4log");
    EXPECT_TRUE(read.bytes.ends_with("0! end\n")) << at;
  }
}

TEST(Mcap, KeepsTheBoardNameOfAFilteredTopic) {
  std::vector<McapRecord> records =
      records_in(converted(recorded_capture(), ".r4log", ".mcap").bytes);
  std::erase_if(records, [](const McapRecord& each) {
    return each.op == Op::channel
               ? each.content.find("/r4log") != std::string::npos
               : each.op == Op::message && each.content.starts_with(std::string("\1\0", 2));
  });
  const Converted read = converted(mcap_file("", as_records(records)), ".mcap", ".r4log");
  EXPECT_TRUE(read.damage.empty());
  EXPECT_TRUE(contains(read.bytes, "# path 1 udp://192.168.0.125 left-arm\n"));
  EXPECT_TRUE(contains(read.bytes, "1< AIN24:24.28"));
}

TEST(Mcap, SkipsTheTopicsOfOtherPrograms) {
  std::vector<McapRecord> records =
      records_in(converted(recorded_capture(), ".r4log", ".mcap").bytes);
  std::string channel, message;
  append_number(channel, std::uint16_t{99});
  append_number(channel, std::uint16_t{0});
  for (const char* const text : {"/camera", "ros1", ""}) tool::mcap::append_string(channel, text);
  append_number(message, std::uint16_t{99});
  message += std::string(20, '\0') + "a picture";
  records.insert(records.begin() + 3,
                 {McapRecord{Op::channel, channel}, McapRecord{Op::message, message}});
  const Converted read = converted(mcap_file("ros1", as_records(records)), ".mcap", ".r4log");
  EXPECT_EQ(read.bytes, recorded_capture());
  EXPECT_TRUE(read.damage.empty());
  const std::string foreign =
      mcap_file("ros1", as_records({{Op::channel, channel}, {Op::message, message}}));
  EXPECT_TRUE(contains(problem_of([&] { converted(foreign, ".mcap", ".r4log"); }).reason,
                       "not a recording of r4"));
}

TEST(Mcap, RefusesRecordingsThatWereMerged) {
  const auto records = [](const std::string& url, std::uint16_t first_id) {
    std::vector<McapRecord> all =
        records_in(converted(recorded_capture(url), ".r4log", ".mcap").bytes);
    std::erase_if(all, [](const McapRecord& each) { return each.op == Op::schema; });
    for (McapRecord& each : all) {
      std::string id;
      append_number(id, static_cast<std::uint16_t>(tool::read_number<std::uint16_t>(each.content) +
                                                   first_id));
      each.content.replace(0, 2, id);
    }
    return all;
  };
  for (const char* const other : {"udp://192.168.0.126", "udp://192.168.0.125"}) {
    const std::vector<McapRecord> left = records("udp://192.168.0.125", 0);
    const std::vector<McapRecord> right = records(other, 10);
    std::vector<McapRecord> mixed;
    for (std::size_t i = 0; i < left.size(); ++i) {
      mixed.push_back(left[i]);
      mixed.push_back(right[i]);
    }
    std::vector<McapRecord> filtered = mixed;  // the messages without the recorded lines
    std::erase_if(filtered, [](const McapRecord& each) {
      return each.op == Op::message && (each.content[0] == 1 || each.content[0] == 11);
    });
    for (const std::vector<McapRecord>& each : {mixed, filtered}) {
      const std::string file = mcap_file("r4log", as_records(each));
      const Problem problem = problem_of([&] { converted(file, ".mcap", ".r4log"); });
      EXPECT_EQ(problem.kind, ErrorKind::data) << other;
      EXPECT_TRUE(contains(problem.reason, "several recordings are mixed")) << problem.reason;
    }
  }
}

}  // namespace
}  // namespace r4::test
