// SPDX-License-Identifier: GPL-3.0-or-later
// The native format as a source and a sink, and the properties that all formats share.
#include "tools/r4/formats/conversion.hpp"

#include <gtest/gtest.h>

#include "converted.hpp"
#include "r4link/recordings/zstd_stream.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

TEST(Conversion, PreservesARecordingReadInPiecesOfAnySize) {
  for (const std::string& native :
       {recorded_capture(), recorded_capture("can://can0?node=3"), generated_recording(3, 5000),
        generated_recording(2, 100'000)}) {
    for (const char* const form : {".r4log", ".r4log.zst", ".pcapng", ".mcap"}) {
      const std::string file = converted(native, ".r4log", form).bytes;
      for (const std::size_t piece : {1, 13, 4096, 10'000'000}) {
        if (piece < file.size() / 100'000) continue;
        const Converted back = converted(file, form, ".r4log", piece);
        EXPECT_EQ(back.bytes, native) << form << ' ' << piece;
        EXPECT_TRUE(back.damage.empty()) << form << ' ' << piece;
      }
    }
  }
}

// The recording is from any program, and may have no line that names the program.
TEST(Conversion, CopiesNoSecretIntoAnotherFile) {
  std::string native;
  write_record_header(native);
  write_path(native, {1, "can://can0?node=1", "arm"});
  for (const char* setting : {"C:password,letmein!;", "C:key,1:letmein!;", "C:pasword,letmein!;"}) {
    write_record(native, {Time{1795468293000001}, 1, RecordKind::to_board,
                          with_crc(std::string(setting) + "PNum:1;T:2;")});
  }
  for (const char* ending : {".r4log", ".r4log.zst", ".jsonl", ".mcap", ".pcapng", ".log"}) {
    const Converted there = converted(native, ".r4log", ending);
    EXPECT_EQ(there.bytes.find("letmein!"), std::string::npos) << ending;
    if (std::string(ending) == ".jsonl") {
      EXPECT_TRUE(contains(there.bytes, R"("fields":{"C":["password","..."]})")) << there.bytes;
      continue;
    }
    const std::string back = converted(there.bytes, ending, ".r4log").bytes;
    EXPECT_TRUE(contains(back, "> " + with_crc("C:password,...;PNum:1;T:2;"))) << ending << back;
    EXPECT_TRUE(contains(back, "> " + with_crc("C:key,1:...;PNum:1;T:2;"))) << ending << back;
  }
}

TEST(Conversion, WritesAReadableFileFromRecordingsWithADamagedHeader) {
  std::string second = recorded_capture("udp://another");
  second[0] = '$';
  for (const char* const form : {".r4log", ".pcapng", ".mcap"}) {
    const Converted first = converted(recorded_capture() + second, ".r4log", form);
    EXPECT_EQ(first.damage.size(), 1);
    const Converted again = converted(first.bytes, form, ".r4log");
    EXPECT_TRUE(again.damage.empty());
    EXPECT_TRUE(contains(again.bytes, "# damage: a part before this could not be read\n"));
    EXPECT_EQ(converted(again.bytes, ".r4log", ".r4log").bytes, again.bytes);
  }
}

TEST(Conversion, AddsAMissingHeaderAndEnd) {
  StringOutput output;
  const auto sink = tool::make_sink("x.r4log", output);
  tool::Conversion conversion(*sink, {});
  conversion.on_path({1, "can://can0?node=1", ""});
  conversion.on_record({Time{1795468293404765}, 1, RecordKind::event, "up"});
  conversion.finish();
  EXPECT_TRUE(output.bytes.starts_with("# r4log 1 by r4 "));
  EXPECT_TRUE(
      output.bytes.ends_with("# path 1 can://can0?node=1\n"
                             "# from 2026-11-23T21:11:33.404765Z\n"
                             "1795468293.404765 1! up\n"
                             "1795468293.404765 0! end\n"));
}

TEST(Conversion, RefusesUnknownFileEndings) {
  StringOutput output;
  for (const char* name : {"x", "x.zst", "x.xlsx", "-", "r4log/x"}) {
    const Problem problem = problem_of([&] { tool::make_sink(name, output); });
    EXPECT_EQ(problem.kind, ErrorKind::usage) << name;
    EXPECT_TRUE(contains(problem.fix, ".r4log.zst"));
  }
  struct Nobody final : RecordingVisitor {
    void on_record(const Record&) override {}
    void on_path(const RecordedPath&) override {}
    void on_damage(const RecordingDamage&) override {}
  } nobody;
  for (const char* name : {"x.csv", "x.jsonl"}) {
    EXPECT_TRUE(
        contains(problem_of([&] { tool::make_source(name, nobody); }).reason, "only written"));
  }
}

TEST(Conversion, RecognizesAFileByItsContents) {
  const std::string native = recorded_capture("can://can0?node=3");
  for (const char* const form : {".r4log", ".log", ".pcapng", ".mcap"}) {
    const std::string file = converted(native, ".r4log", form).bytes;
    const std::string expected = converted(file, form, ".r4log").bytes;
    std::string archive;
    ZstdWriter().write(file, true, archive);
    for (const std::string& bytes : {file, archive}) {
      for (const char* const name : {".txt", ".pcapng0", ".MCAP", ".log", ".r4log", ".zst"}) {
        for (const std::size_t piece : {3, 100'000}) {
          const Converted read = converted(bytes, name, ".r4log", piece);
          EXPECT_EQ(read.bytes, expected) << form << " as " << name;
          EXPECT_TRUE(read.damage.empty());
        }
      }
    }
  }
}

TEST(Conversion, NamesTheKindOfAnUnsupportedFile) {
  for (const char* const name : {".r4log", ".log", ".pcapng", ".gz"}) {
    const std::string file = "\x1F\x8B\x08" + std::string(100, 'x');
    const Problem problem = problem_of([&] { converted(file, name, ".r4log"); });
    EXPECT_TRUE(contains(problem.reason, "compressed by gzip")) << problem.reason;
  }
}

TEST(Conversion, ReportsDamagedCompressionOfAnyFormat) {
  const std::string packets = converted(generated_recording(7, 3000), ".r4log", ".pcapng").bytes;
  std::string archive;
  ZstdWriter writer;
  writer.write(packets.substr(0, packets.size() / 2), true, archive);
  archive.back() ^= 0x55;  // a byte of the checksum
  writer.write(packets.substr(packets.size() / 2), true, archive);
  const Converted read = converted(archive, ".pcapng.zst", ".r4log");
  ASSERT_FALSE(read.damage.empty());
  EXPECT_EQ(read.damage[0].reason, "damaged compression");
}

}  // namespace
}  // namespace r4::test
