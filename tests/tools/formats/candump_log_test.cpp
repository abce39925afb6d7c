// SPDX-License-Identifier: GPL-3.0-or-later
// Converts CAN frames to records, and records to the frames that carry them.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "converted.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

std::string datagram_lines(const std::string& native) {
  std::string lines;
  for (std::size_t at = 0, end = 0; at < native.size(); at = end + 1) {
    end = native.find('\n', at);
    const std::string line = native.substr(at, end - at + 1);
    const std::size_t mark = line.find_first_of("<>!");
    if (line[0] != '#' && line[mark] != '!') lines += line;
  }
  return lines;
}

TEST(CandumpLog, PreservesEveryDatagramOfTheCapture) {
  for (const char* url : {"can://can0?node=3", "can://can0", "can://vcan1?pack=0&node=31",
                          "can://can0?node=0&fd=1"}) {
    const std::string native = recorded_capture(url);
    const Converted log = converted(native, ".r4log", ".log");
    EXPECT_EQ(log.left_out, "2 records without frames on a bus") << url;
    const Converted back = converted(log.bytes, ".log", ".r4log", 7);
    EXPECT_TRUE(back.damage.empty()) << url;
    EXPECT_EQ(datagram_lines(back.bytes), datagram_lines(native)) << url;
  }
}

TEST(CandumpLog, HasTheFramesThatAreOnTheBus) {
  std::string native;
  write_record_header(native);
  write_path(native, {7, "can://can0?node=3&pack=0", "arm"});
  write_record(native, {Time{1436509052249713}, 7, RecordKind::to_board, "E:1;^0x1^"});
  EXPECT_EQ(converted(native, ".r4log", ".log").bytes,
            "(1436509052.249713) can0 183#1009453A313B5E30\n"
            "(1436509052.249713) can0 203#300000\n"
            "(1436509052.249713) can0 183#2178315E\n");
}

TEST(CandumpLog, KeepsStopsAndBoardsThatWentSafe) {
  const std::string native = converted(
                                 "(1436509052.249713) can0 010#\n"
                                 "(1436509052.250713) can0 023#02\n"
                                 "(1436509052.250713) can0 20000004#0000000000000000\n",
                                 ".log", ".r4log")
                                 .bytes;
  EXPECT_TRUE(contains(native, "1436509052.249713 0! stop can0\n"));
  EXPECT_TRUE(contains(native, "1436509052.250713 1! link safe stop\n"));
  EXPECT_TRUE(contains(native, "# path 1 can://can0?node=3\n"));
}

TEST(CandumpLog, ReportsTheLineThatCannotBeRead) {
  const std::string log = converted(recorded_capture("can://can0"), ".r4log", ".log").bytes;
  const std::size_t second = log.find('\n') + 1;
  const std::size_t third = log.find('\n', second) + 1;
  // An invalid line, a line without a time, and a missing frame.
  const Converted result =
      converted("x\n can0 010#\n" + log.substr(0, second) + log.substr(third), ".log", ".r4log");
  ASSERT_EQ(result.damage.size(), 3);
  EXPECT_EQ(result.damage[0].line, 1);
  EXPECT_EQ(result.damage[1].offset, 2);
  EXPECT_TRUE(contains(result.damage[1].reason, "without a time since 1970"));
  EXPECT_EQ(result.damage[2].line, 4);
  EXPECT_TRUE(contains(result.damage[2].reason, "an incomplete datagram of node 1"));
  EXPECT_EQ(
      datagram_lines(result.bytes),
      datagram_lines(recorded_capture()).substr(datagram_lines(recorded_capture()).find('\n') + 1));
}

// The log with other times, in microseconds: time_of(time, earlier time) gives each time.
template <class TimeOf>
std::string counted(const std::string& log, TimeOf time_of) {
  std::string out;
  std::uint64_t first = 0, before = 0;
  for (std::size_t at = 0, end = 0; at < log.size(); at = end + 1) {
    end = log.find('\n', at);
    const std::uint64_t us = std::stoull(log.substr(at + 1)) * 1'000'000 +
                             std::stoull(log.substr(log.find('.', at) + 1));
    if (first == 0) first = before = us;
    const std::uint64_t now = time_of(us - first, us - before);
    before = us;
    out += fmt::format("({:03}.{:06}{}", now / 1'000'000, now % 1'000'000,
                       log.substr(log.find(')', at), end - log.find(')', at) + 1));
  }
  return out;
}

TEST(CandumpLog, RefusesTimesThatDoNotCountFrom1970) {
  const std::string log = converted(recorded_capture("can://can0"), ".r4log", ".log").bytes;
  const std::string from_zero = counted(log, [](auto since, auto) { return since; });
  const std::string differences = counted(log, [](auto, auto gap) { return gap; });
  const std::string zeros = counted(log, [](auto, auto) { return 0; });
  tool::SourceOptions at;
  at.start = Time{1795468293414765};
  for (const std::string& text : {from_zero, differences, zeros}) {
    const Problem problem = problem_of([&] { converted(text, ".log", ".r4log"); });
    EXPECT_EQ(problem.kind, ErrorKind::data);
    EXPECT_TRUE(contains(problem.reason, "do not count from 1970"));
    EXPECT_TRUE(contains(problem.fix, "--start"));
  }
  const auto dated = [&](const std::string& text) {
    return converted(text, ".log", ".r4log", 100, {}, at).bytes;
  };
  EXPECT_EQ(datagram_lines(dated(from_zero)), datagram_lines(recorded_capture()));
  EXPECT_TRUE(contains(problem_of([&] { dated(differences); }).reason, "decrease"));
  EXPECT_TRUE(contains(problem_of([&] { dated(zeros); }).reason, "are the same"));
}

TEST(CandumpLog, RefusesALogWithoutADatagramOfABoard) {
  const std::string foreign = "(1436509052.249713) can0 7DF#0201050000000000\n";
  const Problem problem = problem_of([&] { converted(foreign, ".log", ".r4log"); });
  EXPECT_EQ(problem.kind, ErrorKind::data);
  EXPECT_TRUE(contains(problem.reason, "a complete datagram of a board"));
}

TEST(CandumpLog, PreservesTheChannelNamesOfPythonCan) {
  const std::string log = converted(recorded_capture("can://can0?node=3"), ".r4log", ".log").bytes;
  for (const std::string channel : {"/dev/ttyACM0", "239.74.163.2", "ff15:7079::6173", "a%20b"}) {
    std::string text = log;
    for (std::size_t at = text.find("can0"); at != std::string::npos; at = text.find("can0", at)) {
      text.replace(at, 4, channel);
    }
    const std::string native = converted(text, ".log", ".r4log").bytes;
    EXPECT_EQ(converted(native, ".r4log", ".log").bytes, text) << channel;
  }
}

TEST(CandumpLog, RefusesAFileWithoutFramesAndAUdpRecording) {
  for (const std::string& text :
       {std::string(), std::string("hello\n"), std::string(100'000, '\n')}) {
    EXPECT_EQ(problem_of([&] { converted(text, ".log", ".r4log"); }).reason,
              "is not a log of CAN frames");
  }
  const Problem problem = problem_of([] { converted(recorded_capture(), ".r4log", ".log"); });
  EXPECT_EQ(problem.kind, ErrorKind::data);
  EXPECT_EQ(problem.thing, "udp://192.168.0.125");
  EXPECT_TRUE(contains(problem.fix, ".pcapng"));
}

TEST(CandumpLog, CountsDatagramsThatFitNoTransfer) {
  std::string native;
  write_record_header(native);
  write_path(native, {1, "can://can0", ""});
  for (const std::string& bytes : {std::string(), std::string("\x80 x"), std::string(1025, 'x')}) {
    write_record(native, {Time{1}, 1, RecordKind::from_board, bytes});
  }
  write_record(native, {Time{1}, 1, RecordKind::from_board, "fits"});
  EXPECT_EQ(converted(native, ".r4log", ".log").left_out, "3 records without frames on a bus");
}

}  // namespace
}  // namespace r4::test
