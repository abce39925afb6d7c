// SPDX-License-Identifier: GPL-3.0-or-later
// The threads of r4::Board: calls while a transport delays the link's thread, the notices of a
// callback, and the board while a callback runs.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "r4link/async_board.hpp"
#include "r4link/board.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/board_in_a_thread.hpp"
#include "tests/support/driven_board.hpp"
#include "tests/support/first.hpp"
#include "tests/support/held_carrier.hpp"
#include "tests/support/on_a_loop.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;
using firmware::BoardState;

struct BoardThread : testing::Test {
  struct Enough {};
  BoardThread() { board.wait_active(); }
  void hold_up() {
    hold.begin();
    ASSERT_TRUE(hold.wait_until_held());
  }
  BoardOptions options() {
    BoardOptions result = at_will();
    result.on_wait = [this] {
      if (enough) throw Enough();
    };
    return result;
  }
  // True if the board has executed `command`. Sends another command first, because the board
  // executes commands in order.
  bool has_executed(const std::string& command) {
    board.servo(1).set(Microseconds(1500));
    const std::vector<std::string> all = simulated.executed();
    return std::find(all.begin(), all.end(), command) != all.end();
  }
  std::atomic<bool> enough{false};
  BoardInAThread simulated{"udp"};
  Hold hold;
  Board board{hold.at(simulated.url()), options()};
};

TEST_F(BoardThread, NeverSendsACommandAfterItsCallHasThrown) {
  hold_up();
  const auto begin = std::chrono::steady_clock::now();
  const Problem problem = problem_of([&] { board.send("O:777,1,1", 50ms); });
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 450ms) << "the call must keep its deadline";
  EXPECT_EQ(problem.kind, ErrorKind::refused);
  EXPECT_EQ(problem.thing, "O:777,1,1");
  EXPECT_TRUE(contains(problem.reason, "not sent"));
  EXPECT_TRUE(contains(problem.fix, "transport"));
  hold.release();
  EXPECT_FALSE(has_executed("O:777,1,1"));
}

TEST_F(BoardThread, AnExceptionOfOnWaitEndsTheCallAndNothingIsSent) {
  hold_up();
  States states = board.states();
  enough = true;
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_THROW(board.send("O:777,1,1", 5s), Enough);
  EXPECT_THROW(board.next_state(5s), Enough);
  EXPECT_THROW(states.take(5s), Enough);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 2s);
  enough = false;
  hold.release();
  EXPECT_FALSE(has_executed("O:777,1,1"));
}

TEST_F(BoardThread, SendsAStopEvenAfterItsCallHasTimedOut) {
  hold_up();
  const Problem problem = problem_of([&] { board.stop(20ms); });
  EXPECT_TRUE(contains(problem.reason, "not confirmed"));
  EXPECT_TRUE(contains(problem.fix, "CUT THE POWER"));
  hold.release();
  EXPECT_TRUE(simulated.wait_for(BoardState::safe, SafeReason::stop));
}

// The name of the transport changes each time a USB board is plugged in.
TEST(BoardName, IsNeverTornWhileTheTransportReopens) {
  const std::string path = "/tmp/r4-board-name-" + std::to_string(::getpid());
  auto simulated = std::make_unique<BoardInAThread>("pty:" + path);
  Board board("serial://" + path);
  const std::string name = board.name();
  EXPECT_EQ(name, "serial://" + path);
  std::atomic<bool> up{true};
  board.on_event([&](const CarrierEvent& event) { up = event.kind == CarrierEvent::Kind::up; });
  const auto wait_until = [&](bool wanted) {
    const auto end = std::chrono::steady_clock::now() + 5s;
    while (up != wanted && std::chrono::steady_clock::now() < end) std::this_thread::yield();
    EXPECT_EQ(up, wanted);
  };
  std::atomic<bool> done{false};
  auto asking = std::async(std::launch::async, [&] {
    while (!done) EXPECT_EQ(board.name(), name);
  });
  for (int i = 0; i < 2; ++i) {
    simulated.reset();
    wait_until(false);
    std::filesystem::remove(path);
    simulated = std::make_unique<BoardInAThread>("pty:" + path);
    wait_until(true);
  }
  done = true;
  asking.get();
  board.close();
}

// --- callbacks

TEST(BoardCallbacks, ANewCallbackGetsTheNewestEventLinkAndStateOfASilentBoard) {
  BoardInAThread simulated("udp");
  BoardOptions options;
  options.session.timing.timeout_ms = 50;
  Board board(simulated.url(), options);
  board.wait_active();
  const First<bool> lost;
  board.on_link([lost](const LinkStatus& link) {
    if (link.state == HostLinkState::lost) lost.set(true);
  });
  simulated.switch_off();
  ASSERT_TRUE(lost.get());
  const First<LinkStatus> link;
  board.on_link([link](const LinkStatus& status) { link.set(status); });
  EXPECT_EQ(link.get(), board.link());
  const First<std::uint32_t> state;
  board.on_state([state](const State& newest) { state.set(newest.t_ms); });
  EXPECT_EQ(state.get(), board.state().t_ms);
  const First<CarrierEvent::Kind> event;
  board.on_event([event](const CarrierEvent& newest) { event.set(newest.kind); });
  EXPECT_EQ(event.get(), CarrierEvent::Kind::up);
}

TEST(BoardCallbacks, OnStateIsNotCalledBeforeTheFirstState) {
  Board board("udp://127.0.0.1:9?listen=0");
  std::atomic<bool> called{false};
  board.on_state([&](const State&) { called = true; });
  board.statistics();  // queued after the callback
  EXPECT_FALSE(called);
}

TEST(BoardCallbacks, GivenToTheConstructorGetEveryNotification) {
  std::mutex mutex;
  std::vector<std::string> told;
  const auto note = [&](const std::string& text) {
    const std::lock_guard lock(mutex);
    told.push_back(text);
  };
  {
    BoardCallbacks callbacks;
    callbacks.on_event = [&](const CarrierEvent& event) { note(to_text(event.kind)); };
    callbacks.on_link = [&](const LinkStatus& link) { note(to_text(link.state)); };
    Board board("sim:", {}, callbacks);
    board.wait_active();
    board.next_state();
  }
  ASSERT_GE(told.size(), 3U);
  EXPECT_EQ(told[0], "connecting") << "the first status is from before the transport was opened";
  EXPECT_EQ(told[1], "up");
  EXPECT_EQ(told.back(), "active");
}

TEST(BoardCallbacks, AnEmptyCallbackIsIgnored) {
  Board board("sim:");
  board.on_state(nullptr).cancel();
  board.on_link({}).cancel();
  OnALoop loop;
  AsyncBoard async(loop.io, "sim:");
  async.on_link({}).cancel();
  async.on_state(nullptr);
  async.open();
  EXPECT_TRUE(loop.run_until([&] { return async.state().any(); }));
  board.next_state();
}

struct HangingCallbacks : testing::Test {
  HangingCallbacks() { board.wait_active(); }
  static BoardOptions options() {
    BoardOptions result;
    result.callback_limit = 50ms;
    return result;
  }
  std::promise<void> released;
  BoardInAThread simulated{"udp"};
  Board board{simulated.url(), options()};
};

TEST_F(HangingCallbacks, StopTheHeartbeatsEvenWhileTheyAreBeingAdded) {
  board.on_arming([release = released.get_future().share()](DisarmCause) { release.wait(); });
  EXPECT_TRUE(simulated.wait_for(BoardState::safe, SafeReason::link));
  released.set_value();
  board.wait_active();
}

TEST(BoardCallbacks, NoCallbackFollowsTheOneThatClosesTheBoard) {
  std::promise<void> closed;
  std::atomic<bool> called{false};
  Board board("sim:");
  board.on_state([&](const State&) {
    board.close();
    closed.set_value();
  });
  board.on_state([&](const State&) { called = true; });
  closed.get_future().wait();
  board.close();
  EXPECT_FALSE(called);

  asio::io_context io;
  AsyncBoard async(io, "sim:");
  async.on_state([&](const State&, const Datagram&) { async.close(); });
  async.on_state([&](const State&, const Datagram&) { called = true; });
  async.open();
  io.run_for(5s);
  EXPECT_TRUE(async.state().any());
  EXPECT_FALSE(called);
}

TEST(BoardCallbacks, AreCalledInSubscriptionOrderAndEndOneByOne) {
  const First<std::string> calls;
  std::string order;
  Board board("sim:");
  ScopedSubscription first = board.on_state([&](const State&) { order += 'a'; });
  board.on_state([&, calls](const State&) {
    order += 'b';
    if (order.size() == 8) calls.set(order);
    if (order.size() == 4) first = {};
  });
  EXPECT_EQ(calls.get(), "ababbbbb");
}

// cancel() waits in another thread until a running callback has returned.
TEST(BoardCallbacks, AreNotRunningAfterCancelHasReturned) {
  Board board("sim:");
  std::promise<std::thread::id> running;
  std::atomic<int> calls{0};
  std::atomic<bool> over{false};
  Subscription subscription = board.on_state([&](const State&) {
    if (++calls > 1) return;
    running.set_value(std::this_thread::get_id());
    board.next_state();
    board.next_state();
    over = true;
  });
  auto caller = running.get_future();
  ASSERT_EQ(caller.wait_for(5s), std::future_status::ready);
  EXPECT_NE(caller.get(), std::this_thread::get_id());
  subscription.cancel();
  EXPECT_TRUE(over);
  subscription.cancel();
  const int seen = calls;
  for (int i = 0; i < 3; ++i) board.next_state();
  EXPECT_EQ(calls, seen) << "no state may come after the callback was ended";
}

struct DrivenCallbacks : DrivenBoard {};

TEST_F(DrivenCallbacks, DoNotDelayHeartbeatsWhileTheyRun) {
  const First<std::uint64_t> sent;
  board.on_state([this, sent, done = false](const State&) mutable {
    if (std::exchange(done, true)) return;
    const auto heartbeats = [this] { return board.statistics().heartbeats; };
    const std::uint64_t before = heartbeats();
    const auto end = std::chrono::steady_clock::now() + 4s;
    while (heartbeats() < before + 3 && std::chrono::steady_clock::now() < end) {
    }
    sent.set(heartbeats() - before);
  });
  EXPECT_GE(sent.get(), 3U);
  EXPECT_EQ(board.link().state, HostLinkState::active);
}

TEST_F(HangingCallbacks, StopTheHeartbeatsUntilTheyReturn) {
  const First<Problem> warning;
  board.on_event([warning](const CarrierEvent& event) {
    if (event.kind == CarrierEvent::Kind::warning) warning.set(event.problem);
  });
  board.on_state([release = released.get_future().share()](const State&) { release.wait(); });
  EXPECT_TRUE(simulated.wait_for(BoardState::safe, SafeReason::link));
  EXPECT_EQ(board.link().cause(), LinkCause::callback);
  EXPECT_TRUE(contains(problem_of([&] { board.wait_active(1ms); }).reason, "a callback"));
  released.set_value();
  EXPECT_TRUE(contains(warning.get().reason, "heartbeats stopped"));
  board.wait_active();
}

TEST(BoardCallbacks, ALateCallbackGetsTheNewestState) {
  Board board("sim:");
  board.send("F:DEFAULT");  // no other event follows this command
  std::promise<void> late;
  const First<std::uint32_t> next;
  board.on_state([&, next, calls = 0](const State& state) mutable {
    ++calls;
    if (calls == 1) late.get_future().wait_for(5s);
    if (calls == 2) next.set(state.t_ms);
  });
  std::uint32_t newest = 0;
  for (int i = 0; i < 5; ++i) newest = board.next_state().t_ms;
  // Waiting calls get each state before the callbacks get the same state. When next_state()
  // returns, the callbacks have got the previous state.
  board.next_state();
  late.set_value();
  EXPECT_GE(next.get(), newest);
}

struct BoardLoop : DrivenBoard {};

TEST_F(BoardLoop, EndsPendingCallsAsClosedAndAcceptsNoMore) {
  board.release_control();
  simulated.switch_off();
  std::optional<Outcome> late;
  EXPECT_TRUE(board.post_to_loop([&](AsyncBoard& async) {
    async.take_control();
    async.async_wait_active(1h, [&](const CommandResult& result) { late = result.outcome; });
  }));
  while (board.role() != BoardRole::control) std::this_thread::yield();
  board.close();
  EXPECT_EQ(late, Outcome::closed);
  EXPECT_FALSE(board.post_to_loop([](AsyncBoard&) { ADD_FAILURE() << "the board is closed"; }));
}

}  // namespace
}  // namespace r4::test
