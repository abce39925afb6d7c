// SPDX-License-Identifier: GPL-3.0-or-later
// The timeout and the heartbeat interval of a board are set together.
#include <gtest/gtest.h>

#include "r4link/board.hpp"
#include "tests/support/board_in_a_thread.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

Settings settings_of(BoardInAThread& simulated) {
  Settings settings;
  for (const std::string& command : simulated.executed()) {
    if (!command.starts_with("C:")) continue;
    const auto comma = command.find(',');
    EXPECT_EQ(set(settings, Text(command.substr(2, comma - 2)), Text(command.substr(comma + 1))),
              Refusal::none)
        << command;
  }
  return settings;
}

TEST(BoardTiming, IsRaisedOrLoweredByOneCall) {
  BoardInAThread simulated("udp");
  BoardOptions options;
  options.session.timing.heartbeat_ms = 30;
  Board board(simulated.url(), options);
  board.wait_active();
  EXPECT_TRUE(contains(problem_of([&] { board.setting("timeout", "300"); }).fix, "link_timing()"));
  for (const auto& [timeout, heartbeat] :
       {std::pair(300, 100), std::pair(100, 50), std::pair(10000, 1000), std::pair(1001, 1000),
        std::pair(100, 99), std::pair(1000, 500)}) {
    board.link_timing(std::chrono::milliseconds(timeout), std::chrono::milliseconds(heartbeat), 5s);
    const Settings settings = settings_of(simulated);
    EXPECT_EQ(settings.timeout_ms, timeout);
    EXPECT_EQ(settings.heartbeat_ms, heartbeat);
  }
}

TEST(BoardTiming, RefusesImpossibleTimesBeforeSendingAnything) {
  Board board("sim:");
  for (const auto& wrong :
       {std::pair(99ms, 50ms), std::pair(10001ms, 50ms), std::pair(300ms, 49ms),
        std::pair(300ms, 300ms), std::pair(300ms, 1001ms), std::pair(-1ms, -1ms)}) {
    EXPECT_EQ(problem_of([&] { board.link_timing(wrong.first, wrong.second); }).kind,
              ErrorKind::usage);
  }
  const Problem slow = problem_of([&] { board.link_timing(150ms, 50ms); });
  EXPECT_EQ(slow.kind, ErrorKind::usage);
  EXPECT_TRUE(contains(slow.reason, "this program sends a heartbeat"));
  EXPECT_TRUE(contains(slow.fix, "heartbeat_ms"));
}

}  // namespace
}  // namespace r4::test
