// SPDX-License-Identifier: GPL-3.0-or-later
// An exception of a callback or handler of an AsyncBoard leaves io.run(). The board continues.
#include <gtest/gtest.h>

#include <asio/io_context.hpp>
#include <stdexcept>

#include "r4link/async_board.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/board_in_a_thread.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

struct Thrown : std::runtime_error {
  Thrown() : std::runtime_error("of the user's") {}
};

struct ThrownIn : testing::TestWithParam<std::tuple<const char*, const char*>> {
  const std::string place = std::get<0>(GetParam());
  const std::string transport = std::get<1>(GetParam());
};
using Place = std::tuple<const char*, const char*>;
INSTANTIATE_TEST_SUITE_P(AsyncBoard, ThrownIn,
                         testing::Values(Place("state", "udp"), Place("state", "pty"),
                                         Place("heartbeat", "udp"), Place("link", "udp"),
                                         Place("nack", "pty"), Place("event", "udp"),
                                         Place("event", "pty"), Place("restart", "pty"),
                                         Place("handler", "udp")),
                         [](const auto& p) {
                           return std::string(std::get<0>(p.param)) + "Over" + std::get<1>(p.param);
                         });

TEST_P(ThrownIn, PassesItsExceptionToTheLoopAndTheBoardContinues) {
  BoardInAThread simulated(transport, place == "restart" ? "0.3 reboot\n" : "");
  asio::io_context io;
  AsyncBoard board(io, simulated.url(), at_will());
  int thrown = 0;
  const auto throw_once = [&](const auto&...) {
    if (thrown++ == 0) throw Thrown();
  };
  int states = 0;
  int heartbeats = 0;
  board.on_state([&](const auto&...) {
    ++states;
    if (place == "state") throw_once();
  });
  board.on_board_heartbeat([&](const auto&...) {
    ++heartbeats;
    if (place == "heartbeat") throw_once();
  });
  if (place == "link") board.on_link(throw_once);
  if (place == "nack") board.on_nack(throw_once);
  if (place == "event") board.on_event(throw_once);
  if (place == "restart") board.on_restart(throw_once);
  board.open();
  const Command drive = Command::osmc(1, Pwm(1), Direction::forward);
  if (place == "handler") board.async_send(Command::identify(), 5s, throw_once);
  if (place == "nack") {
    board.async_send(Command::stop(), 5s,
                     [&](const auto&) { board.async_send(drive, 5s, [](const auto&) {}); });
  }
  EXPECT_THROW(io.run_for(5s), Thrown);
  const int states_then = states;
  const int heartbeats_then = heartbeats;
  bool asked = false;
  // Only heartbeats keep the link alive, and the session sends heartbeats only while its timer
  // runs.
  while (states < states_then + 20 || heartbeats < heartbeats_then + 3 || !asked) {
    ASSERT_NE(io.run_one_for(5s), 0U) << "no reception and no timer is pending";
    if (states < states_then + 10 || asked) continue;
    asked = true;
    board.async_send(Command::identify(), 5s, [&](const CommandResult& result) {
      EXPECT_EQ(result.outcome, Outcome::confirmed);
    });
  }
  EXPECT_GE(thrown, 1);
  EXPECT_NE(board.link().state, HostLinkState::lost);
}

}  // namespace
}  // namespace r4::test
