// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <asio/io_context.hpp>
#include <asio/post.hpp>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>

#include "host/standard_registry.hpp"
#include "r4link/board.hpp"
#include "r4link/recordings/record_line.hpp"
#include "tests/support/problems.hpp"
#include "tests/transports/recorder.hpp"
#include "transports/registry.hpp"

namespace r4::test {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

struct Replay : testing::Test {
  Replay() { write_record_header(text); }
  ~Replay() override { fs::remove(file); }
  void add(Time at, const std::string& bytes, RecordKind kind = RecordKind::from_board,
           std::uint16_t path = 1) {
    write_record(text, {Time{1795468293s} + at, path, kind, bytes});
  }
  void play(const std::string& options) {
    std::ofstream(file) << text;
    const auto carrier = standard_registry().make(io, "replay:" + file + options, Role::host);
    carrier->open(heard);
    io.run_for(10s);
    EXPECT_FALSE(carrier->up());
    counters = carrier->counters();
  }

  const std::string file = testing::TempDir() + "r4-replay-" + std::to_string(::getpid());
  std::string text;
  asio::io_context io;
  Recorder heard;
  CarrierCounters counters;
};

TEST_F(Replay, DeliversBoardDatagramsAndTransportEvents) {
  const std::string damaged("\x00\xff x", 4);
  add(0ms, "up udp://x", RecordKind::event);
  add(1ms, "one");
  add(2ms, "ours", RecordKind::to_board);
  add(3ms, "of another", RecordKind::from_board, 2);
  add(4ms, damaged);
  add(5ms, "down udp://x: unplugged", RecordKind::event);
  add(6ms, "up udp://x", RecordKind::event);
  add(7ms, "link active", RecordKind::event);
  add(8ms, "two");
  play("");
  ASSERT_EQ(heard.datagrams.size(), 3);
  EXPECT_EQ(heard.datagrams[0].text, "one");
  EXPECT_EQ(heard.datagrams[1].text, damaged);
  EXPECT_EQ(heard.datagrams[2].text, "two");
  EXPECT_EQ(counters.rx_datagrams, 3);
  EXPECT_EQ(counters.ups, 2);
  EXPECT_EQ(counters.downs, 2) << "one in the recording and one at its end";
  EXPECT_GE(heard.drained, 1);
}

TEST_F(Replay, PlaysAtTheRequestedSpeed) {
  for (int i = 0; i <= 10; ++i) add(i * 1s, std::to_string(i));
  const auto began = std::chrono::steady_clock::now();
  play("?speed=100");
  const auto took = std::chrono::steady_clock::now() - began;
  EXPECT_EQ(heard.datagrams.size(), 11);
  EXPECT_GE(took, 99ms);
  EXPECT_LE(took, 5s);
}

TEST_F(Replay, PlaysTheRequestedPathFromTheRequestedTime) {
  for (int i = 0; i < 10; ++i)
    add(i * 1s, std::to_string(i), RecordKind::from_board, i % 2 == 0 ? 1 : 2);
  play("?speed=1000&from=4.5&path=2");
  ASSERT_EQ(heard.datagrams.size(), 3);
  EXPECT_EQ(heard.datagrams[0].text, "5");
}

TEST_F(Replay, MayBeginAtAClockTimeOfTheRecording) {
  for (int i = 0; i < 10; ++i) add(i * 1s, std::to_string(i));
  play("?speed=1000&from=2026-11-23T21:11:37.5");  // 1795468293 is 21:11:33
  ASSERT_EQ(heard.datagrams.size(), 5);
  EXPECT_EQ(heard.datagrams[0].text, "5");
  const Problem late = problem_of([&] { play("?from=2026-11-23T21:11:42.5Z"); });
  EXPECT_EQ(late.kind, ErrorKind::data);
  EXPECT_TRUE(
      late.reason.starts_with("the last record of that path is of 2026-11-23T21:11:42.000000Z"));
  EXPECT_EQ(problem_of([&] { play("?from=11"); }).reason, late.reason);
  for (const char* wrong :
       {"", "x", "-1", "1795468293", "2026-11-23", "2026-11-23T21:11:37+01:00"}) {
    EXPECT_EQ(problem_of([&] { play(std::string("?from=") + wrong); }).reason,
              std::string(wrong) + " is neither seconds nor a time");
  }
}

TEST_F(Replay, DoesNotBlockTheLoopWhenManyRecordsAreDue) {
  constexpr std::size_t all = 1000;
  for (std::size_t i = 0; i < all; ++i) add(0ms, "at once");
  std::size_t at_the_turn_of_others = 0;
  heard.then = [&](const Recorder::Datagram&) {
    if (heard.datagrams.size() != 1) return;
    asio::post(io, [&] { at_the_turn_of_others = heard.datagrams.size(); });
  };
  play("");
  EXPECT_EQ(heard.datagrams.size(), all);
  EXPECT_LT(at_the_turn_of_others, all / 10);
  EXPECT_EQ(heard.drained, 1) << "the queue must be drained before the end";
}

TEST_F(Replay, ReportsDamageFarAheadOfThePlayedRecord) {
  add(0ms, "one");
  for (int i = 0; i < 2000; ++i) add(0ms, std::string(200, 'x'), RecordKind::from_board, 2);
  text += "no record\n";
  add(1ms, "two");
  play("");
  ASSERT_EQ(heard.count(Kind::warning), 1U);
  EXPECT_EQ(heard.last(Kind::warning)->problem.reason,
            "line 2004: the line does not begin with a time");
  EXPECT_EQ(heard.datagrams.size(), 2U);
}

TEST_F(Replay, RefusesAFileThatItCannotPlay) {
  add(0ms, "one");
  EXPECT_EQ(problem_of([&] { play("?path=3"); }).reason, "that path has no records");
  EXPECT_EQ(problem_of([&] { play("?speed=0"); }).kind, ErrorKind::usage);
  EXPECT_EQ(problem_of([&] { play("?pace=2"); }).kind, ErrorKind::usage);
  EXPECT_EQ(problem_of([&] { Board("replay:"); }).kind, ErrorKind::usage);
  for (const char* none : {"replay:/no/where", "replay:-"}) {
    EXPECT_EQ(problem_of([&] { Board board(none); }).reason, "No such file or directory");
  }
  EXPECT_EQ(problem_of([&] { Board("replay:" + testing::TempDir()); }).reason, "is a directory");
  const std::string fifo = file + "-fifo";
  ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);
  EXPECT_EQ(problem_of([&] { Board("replay:" + fifo); }).reason, "is not a regular file");
  fs::remove(fifo);
  text = "something else";
  EXPECT_EQ(problem_of([&] { play(""); }).reason, "is not a recording");
}

}  // namespace
}  // namespace r4::test
