// SPDX-License-Identifier: GPL-3.0-or-later
#include "host/commands/limits.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "r4link/async_board.hpp"
#include "r4link/board.hpp"
#include "tests/support/board_in_a_thread.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;
using firmware::BoardState;

void expect_usage(const std::string& what, const std::function<void()>& action) {
  const Problem problem = problem_of(action);
  EXPECT_EQ(problem.kind, ErrorKind::usage) << what << ": " << problem.text();
  EXPECT_TRUE(contains(problem.thing, what)) << problem.text();
  EXPECT_FALSE(problem.fix.empty()) << problem.text();
}

TEST(Limits, CoverEverySessionOption) {
  const auto refused = [](const std::string& what, auto change) {
    BoardOptions options;
    change(options.session);
    expect_usage(what, [&] { Board("sim:", options); });
    asio::io_context io;
    expect_usage(what, [&] { AsyncBoard(io, "sim:", options); });
  };
  constexpr auto minus_one = std::numeric_limits<std::uint32_t>::max();
  refused("heartbeat_ms", [](SessionOptions& o) { o.timing.heartbeat_ms = 0; });
  refused("heartbeat_ms", [](SessionOptions& o) { o.timing.heartbeat_ms = minus_one; });
  refused("timeout_ms", [](SessionOptions& o) { o.timing.timeout_ms = 0; });
  refused("timeout_ms", [](SessionOptions& o) { o.timing.timeout_ms = minus_one; });
  for (const auto wrong : {0ms, -1ms, std::chrono::milliseconds::max()}) {
    refused("command_retry", [wrong](SessionOptions& o) { o.command_retry = wrong; });
    refused("stop_retry", [wrong](SessionOptions& o) { o.stop_retry = wrong; });
    if (wrong == 0ms) continue;  // 0 turns this option off
    refused("identify_interval", [wrong](SessionOptions& o) { o.identify_interval = wrong; });
  }
}

TEST(Limits, CoverTheWatchdog) {
  Board board("sim:");
  asio::io_context io;
  AsyncBoard async(io, "sim:");
  for (const auto wrong : {-1ms, std::chrono::milliseconds::max(), Board::Duration(61min)}) {
    expect_usage("watchdog()", [&] { board.watchdog(wrong); });
    expect_usage("watchdog()", [&] { async.watchdog(wrong); });
  }
  board.watchdog(1h);
  board.watchdog(0ms);
}

TEST(Limits, CoverEveryTimeout) {
  Board board("sim:");
  board.wait_active();
  asio::io_context io;
  AsyncBoard async(io, "sim:");
  for (const auto wrong : {-1ms, 0ms, std::chrono::milliseconds::min()}) {
    expect_usage("O:1,1,1", [&] { board.osmc(1).set_pwm(1, Direction::forward, wrong); });
    expect_usage("C:rate,50", [&] { board.setting("rate", "50", wrong); });
    expect_usage("E:CLEAR", [&] { board.send(Command::clear(), wrong); });
    expect_usage("Q:ID", [&] { board.identify(wrong); });
    expect_usage("next_state()", [&] { board.next_state(wrong); });
    expect_usage("async_send()", [&] {
      async.async_send(Command::servo(1, Microseconds(1)), wrong, [](const auto&) {});
    });
    expect_usage("async_send()", [&] {
      async.async_send(Setpoints{Command::servo(1, Microseconds(1))}, wrong, [](const auto&) {});
    });
  }
  expect_usage("wait_active()", [&] { board.wait_active(-1ms); });
  board.wait_active(0ms);
  EXPECT_EQ(board.next_state().osmc(1).pwm, 0);
}

TEST(Limits, NeverPreventAStop) {
  BoardInAThread simulated("udp");
  Board board(simulated.url());
  board.wait_active();
  expect_usage("E:STOP", [&] { board.stop(-1ms); });
  EXPECT_TRUE(simulated.wait_for(BoardState::safe, SafeReason::stop));
}

}  // namespace
}  // namespace r4::test
