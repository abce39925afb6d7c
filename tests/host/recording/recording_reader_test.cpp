// SPDX-License-Identifier: GPL-3.0-or-later
// Reads recordings in every state: damage is reported with its place, and the undamaged records are
// read.
#include "r4link/recordings/recording_reader.hpp"

#include <gtest/gtest.h>
#include <zstd.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "heard.hpp"
#include "r4link/recordings/zstd_stream.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

using DamageKind = RecordingDamage::Kind;

std::string head(const std::string& url = "udp://robot") {
  std::string text;
  write_record_header(text);
  write_path(text, {1, url, "left"});
  return text;
}

const std::string other_head = head("udp://another-robot");
const std::string end_of_it = "1795468299.000000 0! end\n";

std::string lines(int from, int count) {
  std::string text;
  for (int i = from; i < from + count; ++i) {
    const std::string bytes =
        "AIN24:" + std::to_string(i) + ";PNum:" + std::to_string(i) + ";\r\xff";
    write_record(text, {Time{1795468293000000 + 10'000 * i}, 1, RecordKind::from_board, bytes});
  }
  return text;
}

std::string compressed(const std::string& text, bool end_frame = true) {
  ZstdWriter writer;
  std::string out;
  writer.write(text, end_frame, out);
  return out;
}

TEST(RecordingReader, ReadsEveryRecordFromPiecesOfAnySize) {
  const std::string text = lines(0, 50);
  for (const std::string& file : {head() + text, compressed(head() + text)}) {
    for (const std::size_t piece : {1, 2, 3, 7, 64, 100'000}) {
      const Heard heard = heard_in(file, piece);
      EXPECT_EQ(heard.records, text) << piece;
      EXPECT_TRUE(heard.damage.empty()) << piece;
      ASSERT_EQ(heard.paths.size(), 1);
      EXPECT_EQ(heard.paths[0].name, "left");
    }
  }
}

TEST(RecordingReader, ReportsTheLineAndByteOfADamagedLineAndContinues) {
  const std::string before = head() + lines(0, 3);
  const Heard heard = heard_in(before + "nonsense\n" + lines(3, 3), 10);
  EXPECT_EQ(heard.records, lines(0, 6));
  const Heard::Damage expected{DamageKind::line, 7, before.size()};
  ASSERT_EQ(heard.damage.size(), 1);
  EXPECT_EQ(heard.damage[0], expected);
}

TEST(RecordingReader, ReportsALastLineWithoutAnEnd) {
  const std::string whole = head() + lines(0, 3);
  const std::string next = lines(3, 1);
  for (std::size_t cut = 1; cut < next.size(); ++cut) {
    const Heard heard = heard_in(whole + next.substr(0, cut));
    EXPECT_EQ(heard.records, lines(0, 3));
    ASSERT_EQ(heard.damage.size(), 1) << cut;
    EXPECT_EQ(heard.damage[0], (Heard::Damage{DamageKind::torn, 7, whole.size()})) << cut;
  }
}

TEST(RecordingReader, SkipsATooLongLineInLittleMemory) {
  const std::string before = head() + lines(0, 1);
  const std::string longest(max_record_line + 1, 'x');
  for (const std::string& junk : {longest, std::string(3'000'000, 'x')}) {
    const Heard heard = heard_in(before + junk + "\n" + lines(1, 1));
    EXPECT_EQ(heard.records, lines(0, 2));
    ASSERT_EQ(heard.damage.size(), 1);
    EXPECT_EQ(heard.damage[0], (Heard::Damage{DamageKind::line, 5, before.size()}));
  }
}

TEST(RecordingReader, ReadsConcatenatedRecordingsWithDifferentPaths) {
  const std::string a = head() + lines(0, 2), b = other_head + lines(2, 2) + end_of_it;
  for (const std::string& file : {a + b + a, compressed(a) + compressed(b) + compressed(a)}) {
    const Heard heard = heard_in(file, 5);
    EXPECT_EQ(heard.records, lines(0, 4) + end_of_it + lines(0, 2));
    EXPECT_EQ(heard.headers, 3);
    EXPECT_TRUE(heard.damage.empty());
  }
}

TEST(RecordingReader, ReadsTheFlushedPartOfATornFrame) {
  const std::string cut = compressed(head() + lines(0, 20), false);
  const Heard heard = heard_in(cut);
  EXPECT_EQ(heard.records, lines(0, 20));
  ASSERT_EQ(heard.damage.size(), 1);
  EXPECT_EQ(heard.damage[0].kind, DamageKind::torn);
}

TEST(RecordingReader, ContinuesWithTheNextFrameAfterATornFrame) {
  for (const std::size_t piece : {1, 2, 3, 5, 1000}) {
    const Heard heard = heard_in(
        compressed(head() + lines(0, 20), false) + compressed(head() + lines(20, 5)), piece);
    EXPECT_EQ(heard.records, lines(0, 25)) << piece;
    ASSERT_EQ(heard.damage.size(), 1) << piece;
    EXPECT_EQ(heard.damage[0].kind, DamageKind::zstd) << piece;
  }
}

TEST(RecordingReader, GoesOnWithTheNextFrameAfterADamagedByte) {
  const std::string first = compressed(head() + lines(0, 20));
  const std::string second = compressed(lines(20, 20));
  const std::string third = compressed(lines(40, 20));
  for (std::size_t at = 0; at < second.size(); ++at) {
    std::string file = first + second + third;
    file[first.size() + at] = static_cast<char>(file[first.size() + at] ^ 0x55);
    const Heard heard = heard_in(file, 64);
    EXPECT_TRUE(heard.records.starts_with(lines(0, 20))) << at;
    EXPECT_TRUE(heard.records.ends_with(lines(40, 20))) << at;
    EXPECT_FALSE(heard.damage.empty()) << at;
  }
}

TEST(RecordingReader, RefusesAFileThatIsNotARecording) {
  for (const std::string& file :
       {std::string(), std::string("x"), std::string("not one\n"), std::string(200'000, 'x'),
        std::string(200'000, '\n'), compressed(std::string(200'000, 'x')),
        std::string("\x28\xb5\x2f\xfd")}) {
    const Problem problem = problem_of([&] { heard_in(file); });
    EXPECT_EQ(problem.kind, ErrorKind::data);
    EXPECT_EQ(problem.thing, "test");
    EXPECT_EQ(problem.reason, "is not a recording");
  }
}

TEST(RecordingReader, RefusesALaterVersion) {
  const Problem problem = problem_of([] { heard_in("# r4log 2 by r4 9.0\n" + lines(0, 1)); });
  EXPECT_EQ(problem.kind, ErrorKind::data);
  EXPECT_TRUE(contains(problem.reason, "a later version: # r4log 2 by r4 9.0"));
}

TEST(RecordingReader, ReadsLinesThatEndInCrLfAfterAByteOrderMark) {
  const std::string text = head() + lines(0, 20);
  std::string edited = "\xEF\xBB\xBF";
  for (const char c : text) edited += c == '\n' ? std::string("\r\n") : std::string(1, c);
  for (const std::string& file : {edited, compressed(edited)}) {
    for (const std::size_t piece : {1, 2, 7, 100'000}) {
      const Heard heard = heard_in(file, piece);
      EXPECT_EQ(heard.records, lines(0, 20)) << piece;
      EXPECT_TRUE(heard.damage.empty()) << piece;
    }
  }
}

TEST(RecordingReader, NamesTheFormatOfAnotherFileAndAProgramThatReadsIt) {
  struct Other {
    std::string beginning, reason, fix;
  };
  for (const Other& other : {Other{"\x0A\x0D\x0D\x0A", "capture of packets", "r4 convert"},
                             Other{"\xD4\xC3\xB2\xA1", "capture of packets", "r4 convert"},
                             Other{"\x89MCAP0\r\n", "MCAP file", "r4 convert"},
                             Other{"\x1F\x8B\x08", "compressed by gzip", "gzip -dk"},
                             Other{"\xFD\x37zXZ", "compressed by xz", "xz -dk"},
                             Other{"\xFF\xFE#", "UTF-16", "iconv -f UTF-16"},
                             Other{std::string("#\0 \0", 4), "UTF-16", "iconv -f UTF-16"}}) {
    const std::string file = other.beginning + std::string(1000, 'x');
    for (const std::string& bytes : {file, compressed(file)}) {
      const Problem problem = problem_of([&] { heard_in(bytes, 3); });
      EXPECT_EQ(problem.kind, ErrorKind::data);
      EXPECT_TRUE(contains(problem.reason, other.reason)) << problem.reason;
      EXPECT_TRUE(contains(problem.fix, other.fix)) << problem.fix;
    }
  }
}

TEST(RecordingReader, ReadsFilesCompressedByZstdAndPzstd) {
  const std::string text = head() + lines(0, 50);
  // The options --long=27 and --ultra -22, and the bytes that pzstd writes before each frame.
  std::string archive(ZSTD_compressBound(text.size()), '\0');
  const std::unique_ptr<ZSTD_CCtx, decltype(&ZSTD_freeCCtx)> context(ZSTD_createCCtx(),
                                                                     &ZSTD_freeCCtx);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_windowLog, 27);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_contentSizeFlag, 0);
  ZSTD_inBuffer input{text.data(), text.size(), 0};
  ZSTD_outBuffer output{archive.data(), archive.size(), 0};
  ASSERT_EQ(ZSTD_compressStream2(context.get(), &output, &input, ZSTD_e_continue), 0);
  ASSERT_EQ(ZSTD_compressStream2(context.get(), &output, &input, ZSTD_e_end), 0);
  archive.resize(output.pos);
  const std::string skippable("\x50\x2A\x4D\x18\x04\0\0\0abcd", 12);
  for (const std::string& file :
       {archive, skippable + archive,
        skippable + compressed(head() + lines(0, 25)) + skippable + compressed(lines(25, 25))}) {
    const Heard heard = heard_in(file, 5);
    EXPECT_EQ(heard.records, lines(0, 50));
    EXPECT_TRUE(heard.damage.empty());
  }
}

TEST(RecordingReader, RefusesAFrameThatNeedsTooMuchMemory) {
  // A frame with a window of 2 GiB.
  const std::string frame = std::string("\x28\xb5\x2f\xfd\x00\xa8", 6) + std::string(100, '\0');
  const Heard heard = heard_in(compressed(head() + lines(0, 3)) + frame);
  EXPECT_EQ(heard.records, lines(0, 3));
  EXPECT_FALSE(heard.damage.empty());
  const Problem problem = problem_of([&] { heard_in(frame); });
  EXPECT_EQ(problem.kind, ErrorKind::data);
  EXPECT_TRUE(contains(problem.reason, "window of more than 128 MiB"));
  EXPECT_TRUE(contains(problem.fix, "zstd -d --long=31"));
}

// Merges two recordings as `sort -m` does.
std::string merged_by_sort(const std::string& a, const std::string& b) {
  std::vector<std::string> all;
  for (const std::string& file : {a, b}) {
    for (std::size_t at = 0, end = 0; at < file.size(); at = end + 1) {
      end = file.find('\n', at);
      all.push_back(file.substr(at, end - at + 1));
    }
  }
  std::stable_sort(all.begin(), all.end());
  std::string file;
  for (const std::string& line : all) file += line;
  return file;
}

TEST(RecordingReader, RefusesRecordingsThatAreMixed) {
  const std::string left = head() + lines(0, 5) + end_of_it;
  const std::string right = other_head + lines(3, 5) + end_of_it;
  const std::string no_header = right.substr(right.find("# path"));
  for (const std::string& file : {
           merged_by_sort(left, right),
           merged_by_sort(left, left),
           head() + lines(0, 2) + no_header,                             // another path
           head() + other_head + lines(0, 9) + end_of_it + lines(9, 1),  // records after the end
           head() + other_head + lines(0, 9) + end_of_it + end_of_it,
       }) {
    const Problem problem = problem_of([&] { heard_in(file); });
    EXPECT_EQ(problem.kind, ErrorKind::data);
    EXPECT_TRUE(contains(problem.reason, "several recordings are mixed")) << problem.reason;
  }
}

TEST(RecordingReader, ReadsConcatenatedRecordingsOverADamagedHeader) {
  std::string damaged = other_head + lines(2, 2) + end_of_it;
  damaged[0] = '$';
  const Heard heard = heard_in(head() + lines(0, 2) + end_of_it + damaged);
  EXPECT_EQ(heard.records, lines(0, 2) + end_of_it + lines(2, 2) + end_of_it);
  EXPECT_EQ(heard.damage.size(), 1);
}

}  // namespace
}  // namespace r4::test
