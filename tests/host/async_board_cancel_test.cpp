// SPDX-License-Identifier: GPL-3.0-or-later
// The effect of a handler's cancellation slot on the commands of an AsyncBoard.
#include <gtest/gtest.h>

#include <asio/bind_cancellation_slot.hpp>
#include <asio/cancellation_signal.hpp>
#include <asio/co_spawn.hpp>
#include <asio/experimental/awaitable_operators.hpp>
#include <asio/steady_timer.hpp>
#include <asio/use_awaitable.hpp>
#include <functional>
#include <optional>

#include "r4link/async_board.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/on_a_loop.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

const Command run_motor = Command::osmc(1, Pwm(358), Direction::forward);

struct AsyncBoardUnanswered : OnALoop {
  AsyncBoardUnanswered() { board.open(); }

  // Calls `start`, and cancels the call through the slot of its handler. Returns the result.
  template <class Start>
  std::optional<CommandResult> cancelled(Start start) {
    std::optional<CommandResult> result;
    asio::cancellation_signal signal;
    start(asio::bind_cancellation_slot(signal.slot(), [&](const CommandResult& r) {
      result = r;
      board.close();
    }));
    asio::post(io, [&] {
      signal.emit(asio::cancellation_type::terminal);
      EXPECT_FALSE(result) << "never inside the call that cancels it";
    });
    io.run_for(5s);
    signal.emit(asio::cancellation_type::terminal);  // has no effect after the end
    return result;
  }

  AsyncBoard board{io.get_executor(), "udp://127.0.0.1:9?listen=0", at_will()};
};
struct AsyncBoardCancellation : testing::Test, AsyncBoardUnanswered {};

TEST(AsyncBoardCancellations, CancelACommandAnArmALinkTimingAndAWait) {
  const auto expect_cancelled = [](auto start) {
    AsyncBoardUnanswered each;
    const auto result = each.cancelled([&](auto token) { start(each.board, token); });
    ASSERT_TRUE(result);
    EXPECT_EQ(result->outcome, Outcome::cancelled);
  };
  expect_cancelled([](AsyncBoard& board, auto token) { board.async_send(run_motor, 1h, token); });
  expect_cancelled([](AsyncBoard& board, auto token) { board.async_arm(1h, token); });
  expect_cancelled(
      [](AsyncBoard& board, auto token) { board.async_link_timing(800ms, 100ms, 1h, token); });
  expect_cancelled([](AsyncBoard& board, auto token) { board.async_wait_active(1h, token); });
}

TEST_F(AsyncBoardCancellation, EndsTheWaitForAStopButTheStopIsRepeated) {
  asio::cancellation_signal signal;
  const CommandResult result = result_of([&](auto note) {
    board.async_send(Command::stop(), 1h, asio::bind_cancellation_slot(signal.slot(), note));
    asio::post(io, [&] { signal.emit(asio::cancellation_type::terminal); });
  });
  EXPECT_EQ(result.outcome, Outcome::cancelled);
  const std::uint64_t sent = board.statistics().retries;
  EXPECT_TRUE(run_until([&] { return board.statistics().retries >= sent + 3; }))
      << "the stop must be repeated";
}

TEST(AsyncBoardCancel, WorksBetweenTheTwoSettingsOfALinkTiming) {
  asio::io_context io;
  AsyncBoard board(io, "sim:", at_will());
  asio::cancellation_signal signal;
  std::optional<CommandResult> result;
  std::uint64_t confirmed = 0;  // number of commands confirmed so far
  bool begun = false;
  board.on_state([&](const State&, const Datagram&) {
    if (!begun) return;
    if (board.statistics().confirmed > confirmed) signal.emit(asio::cancellation_type::terminal);
  });
  board.open();
  board.async_wait_active(5s, [&](const CommandResult&) {
    confirmed = board.statistics().confirmed;
    begun = true;
    const auto note = [&](const CommandResult& r) {
      result = r;
      board.close();
    };
    board.async_link_timing(800ms, 150ms, 5s, asio::bind_cancellation_slot(signal.slot(), note));
  });
  io.run_for(10s);
  ASSERT_TRUE(result);
  EXPECT_EQ(result->outcome, Outcome::cancelled) << "the first of three commands had been sent";
}

TEST_F(AsyncBoardCancellation, LetsACoroutineWaitForTheFirstOfTwoOperations) {
  using namespace asio::experimental::awaitable_operators;
  std::optional<std::size_t> first;
  const auto race = [&]() -> asio::awaitable<void> {
    asio::steady_timer timer(io, 1ms);
    const auto ended = co_await (board.async_send(run_motor, 1h, asio::use_awaitable) ||
                                 timer.async_wait(asio::use_awaitable));
    first = ended.index();
    board.close();
  };
  asio::co_spawn(io, race(), [](const std::exception_ptr& error) { EXPECT_FALSE(error); });
  io.run_for(5s);
  EXPECT_EQ(first, 1U) << "the timer ends first: the command must not delay it";
}

TEST(AsyncBoardCancel, ReportsThePacketNumberOfTheCommand) {
  asio::io_context io;
  AsyncBoard board(io, "sim:", at_will());
  asio::cancellation_signal signal;
  std::optional<CommandResult> result;
  board.open();
  board.async_wait_active(5s, [&](const CommandResult&) {
    board.async_send(run_motor, 5s,
                     asio::bind_cancellation_slot(signal.slot(), [&](const CommandResult& r) {
                       result = r;
                       board.close();
                     }));
    signal.emit(asio::cancellation_type::terminal);  // the command has been sent
  });
  io.run_for(10s);
  ASSERT_TRUE(result);
  EXPECT_EQ(result->outcome, Outcome::cancelled);
  EXPECT_NE(result->pnum, 0U);
}

}  // namespace
}  // namespace r4::test
