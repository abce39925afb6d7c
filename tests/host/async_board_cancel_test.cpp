// SPDX-License-Identifier: GPL-3.0-or-later
// The effect of a handler's cancellation slot on the commands of an AsyncBoard.
#include <gtest/gtest.h>

#include <asio/bind_cancellation_slot.hpp>
#include <asio/cancellation_signal.hpp>
#include <asio/co_spawn.hpp>
#include <asio/experimental/awaitable_operators.hpp>
#include <asio/steady_timer.hpp>
#include <asio/use_awaitable.hpp>
#include <optional>

#include "r4link/async_board.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/on_a_loop.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

const Command run_motor = Command::osmc(1, Pwm(358), Direction::forward);

struct Cancelling : testing::Test, OnALoop {
  void cancel() { signal.emit(asio::cancellation_type::terminal); }
  // Cancels the call that `start(token)` begins. Returns the result of the call.
  template <class Start>
  CommandResult cancelled(Start start) {
    const CommandResult result = result_of([&](auto note) {
      start(asio::bind_cancellation_slot(signal.slot(), note));
      cancel();  // the handler must not run inside this call
    });
    cancel();  // has no effect after the end
    return result;
  }

  asio::cancellation_signal signal;
};

struct AsyncBoardCancellation : Cancelling {
  AsyncBoardCancellation() { board.open(); }
  AsyncBoard board{io.get_executor(), "udp://127.0.0.1:9?listen=0", at_will()};
};

TEST_F(AsyncBoardCancellation, EndsACommandAnArmALinkTimingAndAWait) {
  const auto expect_cancelled = [&](auto start) {
    EXPECT_EQ(cancelled(start).outcome, Outcome::cancelled);
  };
  expect_cancelled([&](auto token) { board.async_send(run_motor, 1h, token); });
  expect_cancelled([&](auto token) { board.async_arm(1h, token); });
  expect_cancelled([&](auto token) { board.async_link_timing(800ms, 100ms, 1h, token); });
  expect_cancelled([&](auto token) { board.async_wait_active(1h, token); });
}

TEST_F(AsyncBoardCancellation, EndsTheWaitForAStopButTheStopIsRepeated) {
  const CommandResult result =
      cancelled([&](auto token) { board.async_send(Command::stop(), 1h, token); });
  EXPECT_EQ(result.outcome, Outcome::cancelled);
  const std::uint64_t sent = board.statistics().retries;
  EXPECT_TRUE(run_until([&] { return board.statistics().retries >= sent + 3; }))
      << "the stop must be repeated";
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

struct AsyncBoardCancel : Cancelling {
  AsyncBoardCancel() {
    board.open();
    result_of([&](auto active) { board.async_wait_active(5s, active); });
  }
  AsyncBoard board{io, "sim:", at_will()};
};

TEST_F(AsyncBoardCancel, WorksBetweenTheTwoSettingsOfALinkTiming) {
  const std::uint64_t confirmed = board.statistics().confirmed;
  const ScopedSubscription cancelling = board.on_state([&](const State&, const Datagram&) {
    if (board.statistics().confirmed > confirmed) cancel();
  });
  const CommandResult result = result_of([&](auto note) {
    board.async_link_timing(800ms, 150ms, 5s, asio::bind_cancellation_slot(signal.slot(), note));
  });
  EXPECT_EQ(result.outcome, Outcome::cancelled) << "the first of three commands had been sent";
}

TEST_F(AsyncBoardCancel, ReportsThePacketNumberOfTheCommand) {
  const CommandResult result =
      cancelled([&](auto token) { board.async_send(run_motor, 5s, token); });
  EXPECT_EQ(result.outcome, Outcome::cancelled);
  EXPECT_NE(result.pnum, 0U) << "the command had been sent";
}

}  // namespace
}  // namespace r4::test
