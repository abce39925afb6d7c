// SPDX-License-Identifier: GPL-3.0-or-later
// r4::AsyncBoard on one event loop with the simulated board.
#include "r4link/async_board.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <asio/bind_executor.hpp>
#include <asio/strand.hpp>
#include <asio/thread_pool.hpp>
#include <optional>
#include <thread>

#include "host/session/session.hpp"
#include "host/standard_registry.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/board_in_a_thread.hpp"
#include "tests/support/carriers.hpp"
#include "tests/support/datagrams.hpp"
#include "tests/support/on_a_loop.hpp"
#include "tests/support/problems.hpp"
#include "transports/registry.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

const Command start_motor = Command::osmc(1, Pwm(358), Direction::forward);

struct AsyncBoardTest : testing::Test, OnALoop {
  AsyncBoard board{io, "sim:?seed=1", at_will()};
};

// A path on which another host's datagrams are received.
struct Overhearing final : IdleCarrier {
  void overhear(std::string_view bytes) { handler_->on_overheard(bytes); }
};

TEST_F(AsyncBoardTest, MasksTheSecretsOfAnotherHost) {
  auto path = std::make_unique<Overhearing>();
  Overhearing& other = *path;
  AsyncBoard watching(io, std::move(path), at_will());
  std::vector<std::string> heard;
  const auto subscription =
      watching.on_overheard([&](std::string_view bytes) { heard.emplace_back(bytes); });
  watching.open();
  other.overhear(with_crc("C:key,1:5a5a;PNum:1;T:2;"));
  other.overhear(with_crc("O:358,1,1;PNum:2;T:3;"));
  EXPECT_EQ(heard, (std::vector<std::string>{with_crc("C:key,1:...;PNum:1;T:2;"),
                                             with_crc("O:358,1,1;PNum:2;T:3;")}));
}

struct Undrained final : WrappedCarrier {
  using WrappedCarrier::WrappedCarrier;
  void on_drained() override {}
};

// Models a CAN bus: all its hosts are one peer.
struct Bus final : IdleCarrier {
  explicit Bus(std::vector<std::string>& all) : sent(all) {}
  SendResult send(std::string_view bytes, Priority, Peer) override {
    sent.emplace_back(bytes);
    return SendResult::sent;
  }
  bool is_shared() const override { return true; }
  std::vector<std::string>& sent;
};

TEST_F(AsyncBoardTest, AWatcherOnABusSendsOnlyLeasesAndStopsWithAnyTimeout) {
  std::vector<std::string> sent;
  BoardOptions options;
  options.role = BoardRole::watch;
  AsyncBoard watching(io, std::make_unique<Bus>(sent), options);
  EXPECT_EQ(watching.post(Command::stop()), PostResult::no_link) << "the board is not open";
  watching.open();
  result_of([&](auto end) { watching.async_send(Command::identify(), 600ms, end); });
  ASSERT_FALSE(sent.empty());
  for (const std::string& each : sent) EXPECT_EQ(each.substr(0, 2), "W:") << each;
  EXPECT_FALSE(watching.link().causes.has(LinkCause::busy)) << "no host controls the board";
  const auto stops = [&] {
    return std::count_if(sent.begin(), sent.end(),
                         [](const std::string& each) { return each.starts_with("E:STOP;"); });
  };
  for (const auto timeout : {0ms, -1ms}) {
    sent.clear();
    watching.async_send(Command::stop(), timeout, [](const CommandResult&) {});
    EXPECT_EQ(stops(), 1) << timeout.count();
  }
  EXPECT_EQ(watching.post(Command::stop()), PostResult::sent);
  EXPECT_TRUE(run_until([&] { return stops() >= 4; })) << "a posted stop must be repeated";
}

TEST_F(AsyncBoardTest, ReportsStatesOfATransportThatIsNeverDrained) {
  AsyncBoard over(io,
                  std::make_unique<Undrained>(standard_registry().make(io, "sim:", Role::host)));
  int states = 0;
  over.on_state([&](const State&, const Datagram&) { ++states; });
  over.open();
  EXPECT_TRUE(run_until([&] { return states >= 3; }));
}

TEST_F(AsyncBoardTest, WarnsOnceWhenTheLoopWasHeldUp) {
  int warnings = 0;
  board.on_event([&](const CarrierEvent& event) {
    if (event.kind != CarrierEvent::Kind::warning) return;
    EXPECT_TRUE(contains(event.problem.reason, "did not run"));
    ++warnings;
  });
  board.open();
  ASSERT_TRUE(run_until([&] { return board.in_control(); }));
  bool posted = false;
  asio::post(io, [&] {
    const auto end = std::chrono::steady_clock::now() + 350ms;
    while (std::chrono::steady_clock::now() < end) std::this_thread::yield();
    for (int us = 1000; us < 1100; ++us) board.post(Command::servo(1, Microseconds(us)));
    posted = true;
  });
  ASSERT_TRUE(run_until([&] { return posted && board.state().servo_us(1) == 1099; }));
  EXPECT_EQ(warnings, 1);
}

TEST_F(AsyncBoardTest, GivesEverySubscriberTheNewestCause) {
  std::vector<DisarmCause> told;
  AsyncBoard armed(io, "sim:");
  armed.on_arming([&](DisarmCause cause) {
    if (cause == DisarmCause::none)
      armed.async_send(Command::stop(), 1s, [](const CommandResult&) {});
  });
  armed.on_arming([&](DisarmCause cause) { told.push_back(cause); });
  armed.open();
  armed.async_arm(3s, [](const CommandResult&) {});
  ASSERT_TRUE(run_until([&] { return armed.link().reason == SafeReason::stop; }));
  ASSERT_FALSE(told.empty());
  EXPECT_EQ(told.back(), DisarmCause::stop) << "the first board object has stopped the board";
}

TEST_F(AsyncBoardTest, RunsAHandlerOnItsExecutor) {
  asio::thread_pool pool(1);
  std::atomic<bool> done{false};
  std::thread::id where;
  board.open();
  board.async_send(start_motor, 1s,
                   asio::bind_executor(pool.get_executor(), [&](const CommandResult&) {
                     where = std::this_thread::get_id();
                     done = true;
                   }));
  ASSERT_TRUE(run_until([&] { return done.load(); }));
  EXPECT_NE(where, std::this_thread::get_id());
  board.close();
  pool.join();

  auto strand = asio::make_strand(io);
  bool inside = false;
  board.async_send(start_motor, 1s, asio::bind_executor(strand, [&](const CommandResult& result) {
                     inside = strand.running_in_this_thread();
                     EXPECT_EQ(result.outcome, Outcome::closed) << "the board is closed";
                   }));
  io.restart();
  io.run();
  EXPECT_TRUE(inside);
}

TEST_F(AsyncBoardTest, AWaitForAnActiveBoardEndsAtItsDeadline) {
  AsyncBoard silent(io, "udp://127.0.0.1:9?listen=0");
  silent.open();
  const auto wait = [&](auto end) { silent.async_wait_active(20ms, end); };
  EXPECT_EQ(result_of(wait).outcome, Outcome::timed_out);
}

TEST_F(AsyncBoardTest, RefusesTheSixtyFifthCommand) {
  std::vector<Outcome> outcomes;
  const auto note = [&](const CommandResult& result) { outcomes.push_back(result.outcome); };
  board.open();
  for (std::size_t i = 0; i < Session::max_pending + 1; ++i)
    board.async_send(start_motor, 1s, note);
  ASSERT_TRUE(run_until([&] { return outcomes.size() == Session::max_pending + 1; }));
  EXPECT_EQ(outcomes[0], Outcome::full) << "a full queue must be reported at once";
  EXPECT_EQ(std::count(outcomes.begin(), outcomes.end(), Outcome::confirmed),
            static_cast<long>(Session::max_pending));
}

TEST_F(AsyncBoardTest, CloseCancelsCommandsAndEndsAllCallbacks) {
  std::vector<Outcome> outcomes;
  const auto note = [&](const CommandResult& result) { outcomes.push_back(result.outcome); };
  board.open();
  ASSERT_TRUE(run_until([&] { return board.in_control(); }));
  board.async_send(start_motor, 10s, note);
  board.async_send(Command::stop(), 10s, note);
  board.on_state([](const State&, const Datagram&) { ADD_FAILURE() << "called after close()"; });
  board.close();
  board.close();
  board.async_send(start_motor, 1s, note);
  board.async_send(Command::stop(), 1s, note);
  EXPECT_FALSE(board.post(start_motor));
  EXPECT_TRUE(outcomes.empty()) << "handlers run on the loop";
  io.restart();
  io.run();  // returns: no work is left
  const std::vector<Outcome> expected{Outcome::cancelled, Outcome::closed, Outcome::closed,
                                      Outcome::closed};
  EXPECT_EQ(outcomes, expected) << "the stop cancels the first command";
  EXPECT_THROW(board.open(), Error) << "open() is allowed once";
}

// A path that cannot be opened while it reports trouble.
struct Obstructed final : IdleCarrier {
  void open(Handler& handler) override {
    if (trouble) throw Error(*trouble);
    IdleCarrier::open(handler);
  }
  std::optional<Problem> trouble;
};

TEST_F(AsyncBoardTest, OpenFailsIfNoPathOpensAfterAPartialAttempt) {
  auto first = std::make_unique<Obstructed>();
  auto second = std::make_unique<Obstructed>();
  Obstructed* const ends[] = {first.get(), second.get()};
  std::vector<std::unique_ptr<Carrier>> paths;
  paths.push_back(std::move(first));
  paths.push_back(std::move(second));
  AsyncBoard other(io, std::move(paths), at_will());
  ends[1]->trouble = Problem{ErrorKind::usage, "idle:", "", ""};
  EXPECT_EQ(problem_of([&] { other.open(); }).kind, ErrorKind::usage);
  for (Obstructed* const end : ends) end->trouble = Problem{ErrorKind::open, "idle:", "", ""};
  EXPECT_EQ(problem_of([&] { other.open(); }).kind, ErrorKind::open);
}

// The user's code may destroy the board in any callback.
struct DestroyedIn : testing::TestWithParam<const char*>, OnALoop {};
INSTANTIATE_TEST_SUITE_P(AsyncBoard, DestroyedIn,
                         testing::Values("handler", "state", "heartbeat", "link", "nack"),
                         [](const auto& place) { return std::string(place.param); });

TEST_P(DestroyedIn, MayDestroyTheBoard) {
  const std::string place = GetParam();
  BoardInAThread over_udp("udp");
  for (const std::string& url : {std::string("sim:"), over_udp.url()}) {
    auto board = std::make_unique<AsyncBoard>(io, url, at_will());
    int cancelled = 0;
    const auto destroy = [&](const auto&...) { board.reset(); };
    if (place == "state") board->on_state(destroy);
    if (place == "heartbeat") board->on_board_heartbeat(destroy);
    if (place == "link") board->on_link(destroy);
    if (place == "nack") board->on_nack(destroy);
    board->open();
    if (place == "handler") {
      board->async_send(Command::identify(), 10s, destroy);
    } else if (place == "nack") {
      board->async_send(Command::stop(), 1s, [&](const CommandResult&) {
        if (board) board->async_send(start_motor, 1s, [](const CommandResult&) {});
      });
    }
    board->async_send(Command::fields("ENC1"), 10s, [&](const CommandResult& result) {
      cancelled += result.outcome == Outcome::closed ? 1 : 0;
    });
    io.restart();
    io.run();
    EXPECT_FALSE(board);
    EXPECT_EQ(cancelled, 1) << url;
  }
}

// The transport is up at once, and reports the change inside open().
TEST(AsyncBoardEnd, MayBeClosedOrDestroyedInAnEventOfOpen) {
  asio::io_context io;
  AsyncBoard closed(io, "sim:");
  closed.on_event([&](const CarrierEvent&) { closed.close(); });
  closed.open();
  auto destroyed = std::make_unique<AsyncBoard>(io, "sim:", at_will());
  destroyed->on_event([&](const CarrierEvent&) { destroyed.reset(); });
  destroyed->open();
  EXPECT_FALSE(destroyed);
  io.run();  // returns: no timer is left
}

TEST(AsyncBoardEnd, DestroyingTheLoopDestroysTheHandlers) {
  const auto payload = std::make_shared<int>(1);
  {
    asio::io_context io;
    AsyncBoard board(io, "sim:", at_will());
    board.open();
    board.async_send(start_motor, 1s, [payload](const CommandResult&) {});
    io.poll();
  }
  EXPECT_EQ(payload.use_count(), 1);
}

}  // namespace
}  // namespace r4::test
