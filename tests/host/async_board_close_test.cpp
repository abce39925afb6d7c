// SPDX-License-Identifier: GPL-3.0-or-later
// The end of an AsyncBoard: with a farewell that the board answers, or without a farewell.
#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <optional>

#include "r4link/async_board.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/board_in_a_thread.hpp"
#include "tests/support/on_a_loop.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;
using firmware::BoardState;

struct AsyncBoardClose : testing::Test, OnALoop {
  // Drives a board that would stay active for ten seconds without a heartbeat.
  void drive() {
    board->open();
    board->async_send(Command::setting("timeout", "10000"), 3s, [](const CommandResult&) {});
    ASSERT_EQ(result_of([&](auto driven) {
                board->async_send(Command::osmc(1, Pwm(358), Direction::forward), 3s, driven);
              }).outcome,
              Outcome::confirmed);
    ASSERT_TRUE(run_until([&] { return !board->identity().capabilities.empty(); }));
  }
  Outcome close(std::chrono::milliseconds timeout) {
    return result_of([&](auto closed) { board->async_close(timeout, closed); }).outcome;
  }
  auto note() {
    return [this](const CommandResult& result) { end = result; };
  }

  BoardInAThread simulated{"udp"};
  std::unique_ptr<AsyncBoard> board = std::make_unique<AsyncBoard>(io, simulated.url(), at_will());
  std::optional<CommandResult> end;
};

TEST_F(AsyncBoardClose, EndsCallbacksAndCommandsBeforeItIsConfirmed) {
  drive();
  std::optional<CommandResult> waits, late;
  board->async_send(Command::servo(1, Microseconds(1500)), 3s,
                    [&](const CommandResult& result) { waits = result; });
  board->on_state([](const State&, const Datagram&) { ADD_FAILURE() << "a state"; });
  board->on_link([](const LinkStatus&) { ADD_FAILURE() << "the link"; });
  board->on_board_heartbeat([](const Datagram&) { ADD_FAILURE() << "a heartbeat"; });
  board->async_close(1s, note());
  board->async_send(Command::osmc(1, Pwm(5), Direction::forward), 1s,
                    [&](const CommandResult& result) { late = result; });
  EXPECT_EQ(board->post(Command::osmc(1, Pwm(5), Direction::forward)), PostResult::no_link);
  ASSERT_TRUE(run_until([&] { return end && waits && late; }));
  EXPECT_EQ(end->outcome, Outcome::confirmed);
  EXPECT_EQ(waits->outcome, Outcome::closed);
  EXPECT_EQ(late->outcome, Outcome::closed);
  EXPECT_TRUE(simulated.is_without_host());
}

TEST_F(AsyncBoardClose, TimesOutIfTheBoardIsSilent) {
  drive();
  simulated.switch_off();
  EXPECT_NE(close(60ms), Outcome::confirmed);
}

TEST_F(AsyncBoardClose, EndsAtOnceForABoardThatIsNotOpen) {
  EXPECT_EQ(close(1s), Outcome::closed);
  EXPECT_EQ(close(1s), Outcome::closed) << "a second close() has the same result";
}

TEST_F(AsyncBoardClose, EndsWhenTheBoardIsDestroyed) {
  drive();
  board->async_close(1s, note());
  board.reset();
  ASSERT_TRUE(run_until([&] { return end.has_value(); }));
  EXPECT_EQ(end->outcome, Outcome::closed);
}

TEST_F(AsyncBoardClose, SendsTheFarewellWithoutWaiting) {
  drive();
  board->close();
  EXPECT_TRUE(simulated.wait_for(BoardState::safe, SafeReason::link))
      << "the board must be safe long before its timeout";
}

}  // namespace
}  // namespace r4::test
