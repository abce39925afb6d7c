// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/r4/boards/timer.hpp"

#include <gtest/gtest.h>

#include <asio/post.hpp>
#include <chrono>
#include <optional>
#include <string>

namespace r4::tool {
namespace {

using namespace std::chrono_literals;

TEST(CommandTimer, RepeatsATaskUntilItCancelsTheTimer) {
  asio::io_context io;
  Timer timer(io);
  int runs = 0;
  timer.every(1ms, [&] {
    if (++runs == 3) timer.cancel();
  });
  io.run();
  EXPECT_EQ(runs, 3);
}

TEST(CommandTimer, RunsOnlyTheNewestTaskWhichMayReplaceItself) {
  asio::io_context io;
  Timer timer(io);
  std::string ran;
  timer.every(1ms, [&] { ran += "first"; });
  timer.every(1ms, [&] {
    ran += "a";
    timer.after(1ms, [&] { ran += "b"; });
  });
  io.run();
  EXPECT_EQ(ran, "ab");
}

// Both tasks are due, and the loop calls the first task. The first task cancels the second task, or
// destroys its timer.
TEST(CommandTimer, RunsNoTaskAfterACancelEvenIfTheTaskWasDue) {
  for (const bool destroyed : {false, true}) {
    asio::io_context io;
    std::optional<Timer> first(std::in_place, io);
    std::optional<Timer> second(std::in_place, io);
    int runs = 0;
    const auto run = [&](std::optional<Timer>& other) {
      ++runs;
      if (destroyed) {
        other.reset();
      } else {
        other->cancel();
      }
    };
    const Timer::Clock::time_point past = Timer::Clock::now() - 1s;
    first->at(past, [&] { run(second); });
    second->at(past, [&] { run(first); });
    io.run();
    EXPECT_EQ(runs, 1) << destroyed;
  }
}

}  // namespace
}  // namespace r4::tool
