// SPDX-License-Identifier: GPL-3.0-or-later
#include "transports/framing/line_framing.hpp"

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

#include "tests/support/datagrams.hpp"

namespace r4 {
namespace {

using test::captured_state;
using test::str;

using Lines = std::vector<std::string>;

// The lines of a stream that is pushed in pieces of `piece` bytes.
Lines lines_of(LineFraming& framing, const std::string& stream,
               std::size_t piece = ~std::size_t{0}) {
  Lines lines;
  for (std::size_t at = 0; at < stream.size(); at += piece) {
    const std::string part = stream.substr(at, piece);  // separate memory that ends after the call
    framing.push(part.data(), part.size(), [&](Text line) { lines.push_back(str(line)); });
    if (piece > stream.size()) break;
  }
  return lines;
}

Lines lines_of(const std::string& stream, std::size_t piece = ~std::size_t{0}) {
  LineFraming framing;
  return lines_of(framing, stream, piece);
}

TEST(LineFraming, ALineEndsWithCarriageReturnLineFeedOrBoth) {
  EXPECT_EQ(lines_of("a\rb\nc\r\nd\n\re\r\n"), (Lines{"a", "b", "c", "d", "e"}));
}

TEST(LineFraming, SkipsEmptyLines) {
  EXPECT_EQ(lines_of("\n\n\r\r\r\n\na\n\n\nb\r\r\n\n"), (Lines{"a", "b"}));
  EXPECT_EQ(lines_of("\r\n"), Lines{});
}

TEST(LineFraming, KeepsAnUnfinishedLine) {
  LineFraming framing;
  EXPECT_EQ(lines_of(framing, "abc"), Lines{});
  EXPECT_EQ(framing.pending(), 3U);
  EXPECT_EQ(lines_of(framing, "de\nf"), (Lines{"abcde"}));
  EXPECT_EQ(framing.pending(), 1U);
  EXPECT_EQ(lines_of(framing, "\n"), (Lines{"f"}));
  EXPECT_EQ(framing.pending(), 0U);
}

TEST(LineFraming, AnEmptyPushChangesNothing) {
  LineFraming framing;
  framing.push(nullptr, 0, [](Text) { FAIL(); });
  EXPECT_EQ(framing.pending(), 0U);
}

TEST(LineFraming, AWholeLineIsPassedInPlace) {
  const std::string stream = captured_state() + "\r\n";
  LineFraming framing;
  int lines = 0;
  framing.push(stream.data(), stream.size(), [&](Text line) {
    ++lines;
    EXPECT_EQ(line.data(), stream.data());
  });
  EXPECT_EQ(lines, 1);
}

TEST(LineFraming, PassesBytesThatAreNotText) {
  const std::string line("\0\xFF\x7F;^", 5);
  EXPECT_EQ(lines_of(line + "\n"), Lines{line});
}

TEST(LineFraming, PassesTheLongestLineAndDropsALongerOne) {
  const std::string longest(max_datagram, 'x');
  for (const std::size_t piece : {std::size_t{1}, std::size_t{7}, max_datagram, 2 * max_datagram}) {
    LineFraming framing;
    EXPECT_EQ(lines_of(framing, longest + "\n" + longest + "y\n" + longest + "\r\nz\n", piece),
              (Lines{longest, longest, "z"}))
        << piece;
    EXPECT_EQ(framing.oversize(), 1U) << piece;
    EXPECT_EQ(framing.pending(), 0U) << piece;
  }
}

TEST(LineFraming, TenMegabytesWithoutATerminatorAreOneTooLongLine) {
  const std::string noise(10 * 1024 * 1024, '\x55');
  const std::string good = captured_state();
  for (const std::size_t piece : {std::size_t{1021}, noise.size()}) {
    LineFraming framing;
    EXPECT_EQ(lines_of(framing, noise, piece), Lines{});
    EXPECT_EQ(framing.oversize(), 1U);
    EXPECT_LE(framing.pending(), max_datagram);
    EXPECT_EQ(lines_of(framing, good + "\r\n"), Lines{}) << "this terminator ends the noise";
    EXPECT_EQ(lines_of(framing, good + "\r\n"), Lines{good});
    EXPECT_EQ(framing.oversize(), 1U);
  }
}

TEST(LineFraming, ReportsTheBeginningOfATooLongLineOnce) {
  std::string longer;
  for (int i = 0; i < 3000; ++i) longer += static_cast<char>('a' + i % 26);
  const std::string stream = "first\n" + longer + "\nlast\n";
  for (const std::size_t piece : {std::size_t{1}, std::size_t{7}, max_datagram, stream.size()}) {
    LineFraming framing;
    Lines lines, beginnings;
    for (std::size_t at = 0; at < stream.size(); at += piece) {
      const std::string part = stream.substr(at, piece);
      framing.push(
          part.data(), part.size(), [&](Text line) { lines.push_back(str(line)); },
          [&](Text beginning) { beginnings.push_back(str(beginning)); });
    }
    EXPECT_EQ(lines, (Lines{"first", "last"})) << piece;
    EXPECT_EQ(beginnings, Lines{longer.substr(0, max_datagram)}) << piece;
  }
}

TEST(LineFraming, ForgetsAnUnfinishedLineOnReset) {
  LineFraming framing;
  lines_of(framing, "half a li");
  framing.reset();
  EXPECT_EQ(framing.pending(), 0U);
  EXPECT_EQ(lines_of(framing, "whole\n"), Lines{"whole"});
  lines_of(framing, std::string(2000, 'x'));
  framing.reset();
  EXPECT_EQ(lines_of(framing, "whole\n"), Lines{"whole"});
  EXPECT_EQ(framing.oversize(), 1U) << "the counters are kept";
}

TEST(LineFraming, GivesTheSameLinesForPiecesOfAnySize) {
  std::string stream;
  for (const test::CapturedLine& line : test::paper_capture()) stream += line.bytes + "\r\n";
  stream.insert(stream.size() / 2, std::string(1500, 'n') + "\n\r\n");
  const Lines whole = lines_of(stream);
  EXPECT_EQ(whole.size(), 71U) << "one line is lost in the noise, and a part of it is left";
  for (std::size_t piece = 1; piece < 400; ++piece) {
    ASSERT_EQ(lines_of(stream, piece), whole) << "pieces of " << piece;
  }
  for (std::size_t cut = 0; cut <= 400; ++cut) {
    LineFraming framing;
    Lines lines = lines_of(framing, stream.substr(0, cut));
    for (std::string& line : lines_of(framing, stream.substr(cut))) lines.push_back(line);
    ASSERT_EQ(lines, whole) << "cut at " << cut;
  }
}

TEST(LineFraming, GivesTheSameLinesForRandomPieces) {
  std::mt19937 random(1);
  for (int round = 0; round < 300; ++round) {
    std::string stream;
    while (stream.size() < 6000) {
      const std::size_t size = random() % 8 == 0 ? random() % 1500 : random() % 40;
      stream += std::string(size, static_cast<char>('a' + random() % 26));
      stream += std::string_view("\r\n\n\r").substr(random() % 3, 1 + random() % 2);
    }
    const Lines whole = lines_of(stream);
    LineFraming framing;
    Lines lines;
    for (std::size_t at = 0; at < stream.size();) {
      const std::string part = stream.substr(at, random() % 300);
      at += part.size();
      for (std::string& line : lines_of(framing, part)) lines.push_back(line);
    }
    ASSERT_EQ(lines, whole) << "round " << round;
  }
}

}  // namespace
}  // namespace r4
