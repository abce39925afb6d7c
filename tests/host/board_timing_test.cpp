// SPDX-License-Identifier: GPL-3.0-or-later
// The timeout and the heartbeat interval of a board are set together. After wait_active() the
// program has control.
#include <gtest/gtest.h>

#include <optional>

#include "r4link/async_board.hpp"
#include "r4link/board.hpp"
#include "tests/support/board_in_a_thread.hpp"
#include "tests/support/on_a_loop.hpp"
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

struct AsyncBoardActive : testing::Test, OnALoop {};

TEST_F(AsyncBoardActive, SendsAPostMadeAsSoonAsTheBoardIsActive) {
  BoardInAThread simulated("udp");
  AsyncBoard board(io, simulated.url());
  board.open();
  std::optional<PostResult> posted;
  board.async_wait_active(5s, [&](const CommandResult& result) {
    EXPECT_EQ(result.outcome, Outcome::confirmed);
    posted = board.post(Command::setting("rate", "50"));
  });
  ASSERT_TRUE(run_until([&] { return posted.has_value(); }));
  EXPECT_TRUE(*posted);
}

TEST_F(AsyncBoardActive, EndsAtItsDeadlineOrWithTheBoard) {
  AsyncBoard board(io, "udp://127.0.0.1:9?listen=0");
  board.open();
  const auto begin = std::chrono::steady_clock::now();
  std::optional<CommandResult> closed;
  board.async_wait_active(5s, [&](const CommandResult& result) { closed = result; });
  const auto wait = [&](auto end) { board.async_wait_active(20ms, end); };
  EXPECT_EQ(result_of(wait).outcome, Outcome::timed_out);
  board.close();
  ASSERT_TRUE(run_until([&] { return closed.has_value(); }));
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 4s);
  EXPECT_EQ(closed->outcome, Outcome::closed);
}

}  // namespace
}  // namespace r4::test
