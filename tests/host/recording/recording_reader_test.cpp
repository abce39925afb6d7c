// SPDX-License-Identifier: GPL-3.0-or-later
// Whatever has become of a recording: what can be read is read, and the rest has a place.
#include "host/recording/recording_reader.hpp"

#include <gtest/gtest.h>

#include <string>

#include "heard.hpp"
#include "host/recording/zstd_stream.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

using DamageKind = RecordingDamage::Kind;

std::string head() {
  std::string text;
  write_record_header(text);
  write_wire(text, {1, "udp://robot", "left"});
  return text;
}

// Records that differ, as lines.
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

TEST(RecordingReader, GivesEveryRecordHoweverTheBytesCome) {
  const std::string text = lines(0, 50);
  for (const std::string& file : {head() + text, compressed(head() + text)}) {
    for (const std::size_t piece : {1, 2, 3, 7, 64, 100'000}) {
      const Heard heard = heard_in(file, piece);
      EXPECT_EQ(heard.records, text) << piece;
      EXPECT_TRUE(heard.damage.empty()) << piece;
      ASSERT_EQ(heard.wires.size(), 1);
      EXPECT_EQ(heard.wires[0].name, "left");
    }
  }
}

TEST(RecordingReader, TellsThePlaceOfADamagedLineAndGoesOn) {
  const std::string before = head() + lines(0, 3);
  const Heard heard = heard_in(before + "nonsense\n" + lines(3, 3), 10);
  EXPECT_EQ(heard.records, lines(0, 6));
  const Heard::Damage expected{DamageKind::line, 7, before.size()};
  ASSERT_EQ(heard.damage.size(), 1);
  EXPECT_EQ(heard.damage[0], expected);
}

TEST(RecordingReader, TellsOfALastLineWithoutAnEnd) {
  const std::string whole = head() + lines(0, 3);
  const std::string next = lines(3, 1);
  for (std::size_t cut = 1; cut < next.size(); ++cut) {
    const Heard heard = heard_in(whole + next.substr(0, cut));
    EXPECT_EQ(heard.records, lines(0, 3));
    ASSERT_EQ(heard.damage.size(), 1) << cut;
    EXPECT_EQ(heard.damage[0], (Heard::Damage{DamageKind::torn, 7, whole.size()})) << cut;
  }
}

TEST(RecordingReader, PassesOverALineThatIsLongerThanAnyInLittleMemory) {
  const std::string before = head() + lines(0, 1);
  const std::string longest(max_record_line + 1, 'x');
  for (const std::string& junk : {longest, std::string(3'000'000, 'x')}) {
    const Heard heard = heard_in(before + junk + "\n" + lines(1, 1));
    EXPECT_EQ(heard.records, lines(0, 2));
    ASSERT_EQ(heard.damage.size(), 1);
    EXPECT_EQ(heard.damage[0], (Heard::Damage{DamageKind::line, 5, before.size()}));
  }
}

TEST(RecordingReader, ReadsAFileThatHoldsSeveralRecordings) {
  const Heard text = heard_in(head() + lines(0, 2) + head() + lines(2, 2));
  EXPECT_EQ(text.records, lines(0, 4));
  EXPECT_EQ(text.headers, 2);
  const Heard frames =
      heard_in(compressed(head() + lines(0, 2)) + compressed(head() + lines(2, 2)), 5);
  EXPECT_EQ(frames.records, lines(0, 4));
  EXPECT_TRUE(frames.damage.empty());
}

TEST(RecordingReader, ReadsAllThatWasFlushedOfAFrameWithoutAnEnd) {
  const std::string cut = compressed(head() + lines(0, 20), false);
  const Heard heard = heard_in(cut);
  EXPECT_EQ(heard.records, lines(0, 20));
  ASSERT_EQ(heard.damage.size(), 1);
  EXPECT_EQ(heard.damage[0].kind, DamageKind::torn);
}

TEST(RecordingReader, GoesOnWithTheNextFrameWhereOneHasNoEnd) {
  for (const std::size_t piece : {1, 2, 3, 5, 1000}) {
    const Heard heard = heard_in(
        compressed(head() + lines(0, 20), false) + compressed(head() + lines(20, 5)), piece);
    EXPECT_EQ(heard.records, lines(0, 25)) << piece;
    ASSERT_EQ(heard.damage.size(), 1) << piece;
    EXPECT_EQ(heard.damage[0].kind, DamageKind::zstd) << piece;
  }
}

TEST(RecordingReader, GoesOnWithTheNextFrameBehindADamagedByte) {
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

TEST(RecordingReader, RefusesWhatIsNoRecording) {
  for (const std::string& file :
       {std::string(), std::string("x"), std::string("not one\n"), std::string(200'000, 'x'),
        std::string(200'000, '\n'), compressed(std::string(200'000, 'x')),
        std::string("\x28\xb5\x2f\xfd")}) {
    const Problem problem = problem_of([&] { heard_in(file); });
    EXPECT_EQ(problem.kind, ErrorKind::data);
    EXPECT_EQ(problem.thing, "test");
    EXPECT_EQ(problem.reason, "no recording");
  }
}

TEST(RecordingReader, RefusesALaterVersion) {
  const Problem problem = problem_of([] { heard_in("# r4log 2 by r4 9.0\n" + lines(0, 1)); });
  EXPECT_EQ(problem.kind, ErrorKind::data);
  EXPECT_TRUE(contains(problem.reason, "a later version: # r4log 2 by r4 9.0"));
}

TEST(RecordingReader, RefusesAFrameThatWantsMuchMemory) {
  // A window of 2 GiB.
  std::string file = compressed(head() + lines(0, 3));
  file += std::string("\x28\xb5\x2f\xfd\x00\xa8", 6) + std::string(100, '\0');
  const Heard heard = heard_in(file);
  EXPECT_EQ(heard.records, lines(0, 3));
  EXPECT_FALSE(heard.damage.empty());
}

}  // namespace
}  // namespace r4::test
