// SPDX-License-Identifier: GPL-3.0-or-later
// A board's link is recorded while it runs. A fault of the recording must not disturb the link.
#include "host/recording/recorder.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <mutex>
#include <optional>
#include <regex>
#include <string>

#include "heard.hpp"
#include "r4link/board.hpp"
#include "tests/bench/allocations.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/board_in_a_thread.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

struct RecordingOfABoard : testing::Test {
  RecordingOfABoard() { fs::create_directory(folder); }
  ~RecordingOfABoard() override { fs::remove_all(folder); }
  std::string path(const std::string& name = "a.r4log") const { return (folder / name).string(); }
  Heard heard(const std::string& name = "a.r4log") const {
    std::ifstream file(path(name), std::ios::binary);
    return heard_in(std::string{std::istreambuf_iterator<char>(file), {}});
  }
  const fs::path folder =
      fs::path(testing::TempDir()) / ("r4-recorder-" + std::to_string(::getpid()));
};

bool has(const Heard& heard, const std::string& pattern) {
  return std::regex_search(heard.records, std::regex(pattern));
}

TEST_F(RecordingOfABoard, HasBothDirectionsAndTheEvents) {
  {
    Board board("sim:", at_will());
    board.record(path());
    board.wait_active();
    board.osmc(1).set_pwm(358, Direction::forward);
    board.stop();
    board.identify();
    board.close();
  }
  const Heard all = heard();
  EXPECT_TRUE(all.damage.empty());
  ASSERT_FALSE(all.paths.empty());
  EXPECT_EQ(all.paths.front().number, 1);
  EXPECT_TRUE(contains(all.paths.front().url, "sim:"));
  EXPECT_EQ(all.paths.back().name, "sim-1");
  for (const char* const line :
       {" 1! up sim:", " 1> H:ROS2-R4;", " 1< AIN24:", " 1> O:358,1,1;", " 1! link active",
        " 1> E:STOP;", " 1! link safe stop", " 1< I:R4,", " 1> E:LEAVE;", " 0! end"}) {
    EXPECT_TRUE(has(all, line)) << line;
  }
}

TEST_F(RecordingOfABoard, ReportsAFullDiskAndTheLinkContinues) {
  std::mutex mutex;
  std::condition_variable told;
  std::optional<Problem> problem;
  Board board("sim:", at_will());
  const ScopedSubscription events = board.on_event([&](const CarrierEvent& event) {
    const std::lock_guard lock(mutex);
    if (event.kind == CarrierEvent::Kind::warning) problem = event.problem;
    told.notify_all();
  });
  board.wait_active();
  {
    const FileLimit limit(
        5000);  // the recorder's thread blocks SIGXFSZ, which would end this process
    board.record(path());
    std::unique_lock lock(mutex);
    EXPECT_TRUE(told.wait_for(lock, 10s, [&] { return problem.has_value(); }));
  }
  ASSERT_TRUE(problem);
  EXPECT_EQ(problem->kind, ErrorKind::open);
  EXPECT_EQ(problem->thing, path());
  EXPECT_TRUE(contains(problem->fix, "--keep"));
  board.osmc(1).set_pwm(358, Direction::forward);
  EXPECT_TRUE(heard().damage.empty());
  board.record(path("next.r4log"));
  board.next_state();
  board.close();
  EXPECT_TRUE(has(heard("next.r4log"), " 1< AIN24:"));
}

TEST_F(RecordingOfABoard, ThrowsFromRecordIfItsFileCannotBeOpened) {
  Board board("sim:", at_will());
  EXPECT_EQ(problem_of([&] { board.record(path("no/where")); }).kind, ErrorKind::open);
  board.wait_active();
}

TEST_F(RecordingOfABoard, MayEndBeforeTheBoard) {
  Board board("sim:", at_will());
  {
    Recording recording(path());
    board.record(recording);
    board.wait_active();
  }
  board.next_state();
  EXPECT_TRUE(has(heard(), " 0! end"));
}

TEST_F(RecordingOfABoard, IsOrderedByTheTimesOfItsRecords) {
  const Time began = std::chrono::duration_cast<Time>(
      (std::chrono::steady_clock::now() - 20ms).time_since_epoch());
  Recorder recorder(path(), {});
  const std::uint16_t left = recorder.add_path("a"), right = recorder.add_path("b");
  for (const auto& [path, at] : {std::pair{left, 5ms}, {left, 15ms}, {right, 1ms}, {right, 15ms}}) {
    recorder.record(path, RecordKind::from_board, std::to_string(at.count()), began + at);
  }
  recorder.close();
  const Heard all = heard();
  const std::regex lines(R"(\S+ 2< 1\n\S+ 1< 5\n\S+ 1< 15\n\S+ 2< 15\n\S+ 0! end\n)");
  EXPECT_TRUE(std::regex_match(all.records, lines)) << all.records;
}

TEST_F(RecordingOfABoard, AllocatesNothingPerDatagramAndCountsDropped) {
  Recorder recorder(path(), {});
  const std::uint16_t path = recorder.add_path("sim:");
  const std::string datagram(1000, 'x');
  const std::uint64_t before = bench::allocations_of_this_thread();
  // The test records faster than a disk can write.
  for (int i = 0; i < 50'000; ++i) recorder.record(path, RecordKind::from_board, datagram);
  EXPECT_EQ(bench::allocations_of_this_thread(), before);
  recorder.close();
  const Heard all = heard();
  EXPECT_TRUE(all.damage.empty());
  std::uint64_t dropped = 0;
  for (const std::string& event : all.events) {
    if (event.starts_with("dropped ")) dropped += std::stoull(event.substr(8));
  }
  EXPECT_EQ(dropped, recorder.dropped());
  EXPECT_EQ(recorder.records() + dropped, 50'000);
}

}  // namespace
}  // namespace r4::test
