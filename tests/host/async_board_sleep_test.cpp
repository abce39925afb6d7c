// SPDX-License-Identifier: GPL-3.0-or-later
// A host whose machine sleeps. This test program replaces the boot clock, so that it can set the
// clock forward.
#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <asio/io_context.hpp>
#include <atomic>
#include <ctime>
#include <future>
#include <optional>
#include <string>
#include <vector>

#include "r4link/async_board.hpp"
#include "r4link/board.hpp"
#include "r4link/control/boot_clock.hpp"
#include "r4link/error.hpp"
#include "tests/support/board_in_a_thread.hpp"
#include "tests/support/held_carrier.hpp"
#include "tests/support/on_a_loop.hpp"

namespace {

std::atomic<int> slept_seconds{0};

}  // namespace

// Replaces the function of the C library.
extern "C" int clock_gettime(clockid_t clock, timespec* time) noexcept {
  const auto result = static_cast<int>(syscall(SYS_clock_gettime, clock, time));
  if (clock == CLOCK_BOOTTIME) time->tv_sec += slept_seconds;
  return result;
}

namespace r4::test {
namespace {

using namespace std::chrono_literals;

Time steady_time() {
  return std::chrono::duration_cast<Time>(std::chrono::steady_clock::now().time_since_epoch());
}

TEST(SleepWatchTest, ReportsASleepThatIsLongerThanTheLimitOnce) {
  SleepWatch watch;
  EXPECT_FALSE(watch.slept(steady_time(), 1s));
  slept_seconds += 2;
  EXPECT_TRUE(watch.slept(steady_time(), 1s));
  EXPECT_FALSE(watch.slept(steady_time(), 1s));
  slept_seconds += 1;
  EXPECT_FALSE(watch.slept(steady_time(), 2s));
}

TEST(SleepWatchTest, DoesNotMistakeABusyProcessorForASleep) {
  SleepWatch watch;
  const Time before = steady_time() - 5s;  // the steady clock is read 5 s before the boot clock
  EXPECT_FALSE(watch.slept(before, 1s));
  slept_seconds += 2;
  EXPECT_TRUE(watch.slept(steady_time(), 1s));
}

struct AsyncBoardSleep : testing::Test, OnALoop {};

TEST_F(AsyncBoardSleep, DisarmsAndSwitchesTheMotorsOff) {
  BoardInAThread simulated("udp");
  AsyncBoard board(io, simulated.url());
  int restarts = 0;
  board.on_restart([&] { ++restarts; });
  board.open();
  ASSERT_EQ(result_of([&](auto armed) { board.async_arm(10s, armed); }).outcome,
            Outcome::confirmed);
  ASSERT_TRUE(board.post(Command::osmc(1, Pwm(500), Direction::forward)));
  ASSERT_TRUE(run_until([&] { return board.state().osmc(1).pwm == 500; }));

  slept_seconds += 3;
  ASSERT_TRUE(run_until([&] { return board.disarmed_by() != DisarmCause::none; }));
  EXPECT_EQ(board.disarmed_by(), DisarmCause::sleep);
  EXPECT_EQ(board.post(Command::osmc(1, Pwm(500), Direction::forward)), PostResult::no_link);
  EXPECT_EQ(restarts, 1);
  ASSERT_TRUE(run_until([&] { return board.in_control() && board.state().any(); }));
  EXPECT_EQ(board.state().osmc(1).pwm, 0) << "another session has begun, without setpoints";
  EXPECT_EQ(board.post(Command::osmc(1, Pwm(500), Direction::forward)), PostResult::not_armed);
  EXPECT_EQ(restarts, 1);
}

TEST_F(AsyncBoardSleep, CancelsCommandsAndWaits) {
  AsyncBoard board(io, "udp://127.0.0.1:1?listen=0");  // there is no board
  board.open();
  std::vector<Outcome> ends;
  const auto note = [&](const CommandResult& result) { ends.push_back(result.outcome); };
  board.async_wait_active(30s, note);
  board.async_arm(30s, note);
  board.async_send(Command::osmc(1, Pwm(500), Direction::forward), 30s, note);
  io.run_for(20ms);
  ASSERT_TRUE(ends.empty());
  slept_seconds += 3;
  ASSERT_TRUE(run_until([&] { return ends.size() == 3; }));
  EXPECT_EQ(ends, std::vector<Outcome>(3, Outcome::cancelled));
}

TEST(BoardSleep, DoesNotBeginACallAfterASleep) {
  BoardInAThread simulated("udp");
  Hold hold;
  std::atomic<int> waits{0};
  BoardOptions options;
  options.on_wait = [&] {
    ++waits;
    waits.notify_all();
  };
  Board board(hold.at(simulated.url()), options);
  board.wait_active();
  hold.begin();
  ASSERT_TRUE(hold.wait_until_held());
  const int before = waits;
  auto armed = std::async(std::launch::async, [&] { board.arm(2s); });
  waits.wait(before);  // then the call is in the queue of the loop
  slept_seconds += 3;
  hold.release();
  EXPECT_THROW(armed.get(), Error);
  const std::vector<std::string> executed = simulated.executed();
  EXPECT_EQ(std::count(executed.begin(), executed.end(), "R:1,On"), 0);
}

}  // namespace
}  // namespace r4::test
