// SPDX-License-Identifier: GPL-3.0-or-later
// r4::Board and its thread: what becomes of a call while a callback holds the thread, and what a
// callback is told when it is set.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <future>
#include <memory>
#include <mutex>
#include <thread>

#include "host/board.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/board_in_a_thread.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;
using firmware::BoardState;

// Holds the board's thread in a callback, from the first state for which `when` is true on.
class Hold {
 public:
  template <class When>
  Hold(Board& board, When when) {
    board.on_state([turn = turn_, when, done = false](const State&) mutable {
      if (done || !when()) return;
      done = true;
      turn->reach(Turn::Stage::held);
      turn->wait_for(Turn::Stage::released);
    });
  }
  explicit Hold(Board& board) : Hold(board, [] { return true; }) {}
  void wait_until_held() { ASSERT_TRUE(turn_->wait_for(Turn::Stage::held)); }
  void release() { turn_->reach(Turn::Stage::released); }

 private:
  // It outlives both threads' use of it.
  class Turn {
   public:
    enum class Stage : std::uint8_t { free, held, released };
    void reach(Stage stage) {
      const std::lock_guard lock(mutex_);
      stage_ = stage;
      changed_.notify_all();
    }
    bool wait_for(Stage stage) {
      std::unique_lock lock(mutex_);
      return changed_.wait_for(lock, 5s, [&] { return stage_ >= stage; });
    }

   private:
    std::mutex mutex_;
    std::condition_variable changed_;
    Stage stage_ = Stage::free;
  };
  std::shared_ptr<Turn> turn_ = std::make_shared<Turn>();
};

struct BoardThread : testing::Test {
  BoardThread() { board.wait_active(); }
  bool has_executed(const std::string& command) {
    const std::vector<std::string> all = simulated.executed();
    return std::find(all.begin(), all.end(), command) != all.end();
  }
  BoardInAThread simulated{"udp"};
  Board board{simulated.url(), at_will()};
};

TEST_F(BoardThread, NeverSendsACommandWhoseCallHasThrown) {
  Hold hold(board);
  hold.wait_until_held();
  const auto begin = std::chrono::steady_clock::now();
  const Problem problem = problem_of([&] { board.send("O:777,1,1", 50ms); });
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 450ms) << "the deadline is that of the call";
  EXPECT_EQ(problem.kind, ErrorKind::refused);
  EXPECT_EQ(problem.thing, "O:777,1,1");
  EXPECT_TRUE(contains(problem.reason, "not sent"));
  EXPECT_TRUE(contains(problem.fix, "callback"));
  hold.release();
  board.servo(1).set(1500);  // behind it
  EXPECT_FALSE(has_executed("O:777,1,1"));
}

TEST_F(BoardThread, SaysWhereACommandMayHaveBeenExecuted) {
  Hold hold(board, [&] { return has_executed("O:777,1,1"); });
  const Problem problem = problem_of([&] { board.send("O:777,1,1", 50ms); });
  EXPECT_TRUE(contains(problem.reason, "it may have been executed"));
  hold.release();
}

TEST_F(BoardThread, SendsAStopHoweverLate) {
  Hold hold(board);
  hold.wait_until_held();
  const Problem problem = problem_of([&] { board.stop(20ms); });
  EXPECT_TRUE(contains(problem.reason, "not confirmed"));
  EXPECT_TRUE(contains(problem.fix, "CUT THE POWER"));
  hold.release();
  EXPECT_TRUE(simulated.wait_for(BoardState::safe, SafeReason::stop));
}

TEST_F(BoardThread, NeverCallsACallbackThatItDidNotTake) {
  Hold hold(board);
  hold.wait_until_held();
  std::atomic<bool> called{false};
  const auto payload = std::make_shared<int>(1);
  const auto set_all = [&] {
    problem_of([&] { board.on_state([&, payload](const State&) { called = true; }); });
    problem_of([&] { board.on_link([&, payload](const LinkStatus&) { called = true; }); });
    return problem_of(
        [&] { board.on_event([&, payload](const CarrierEvent&) { called = true; }); });
  };
  EXPECT_TRUE(contains(set_all().reason, "not done"));
  hold.release();
  board.stop();  // a change of the link, and states
  board.next_state();
  EXPECT_FALSE(called);
  EXPECT_EQ(payload.use_count(), 1);
}

// The transport's name is written anew each time a USB board comes back.
TEST(BoardName, IsWholeHoweverOftenTheBoardIsPluggedIn) {
  const std::string path = "/tmp/r4-board-name-" + std::to_string(::getpid());
  auto simulated = std::make_unique<BoardInAThread>("pty:" + path);
  Board board("serial://" + path);
  board.watchdog(1ms);  // is never fed, so nobody's waiting ends
  auto waiting =
      std::async(std::launch::async, [&] { return problem_of([&] { board.wait_active(60s); }); });
  ASSERT_EQ(waiting.wait_for(50ms), std::future_status::timeout);
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
  EXPECT_EQ(waiting.get().thing, name);
}

// --- what a callback is told when it is set

TEST(BoardCallbacks, AreToldThatTheTransportIsUp) {
  for (int i = 0; i < 20; ++i) {
    Board board("sim:");
    std::promise<CarrierEvent::Kind> told;
    board.on_event([&, first = true](const CarrierEvent& event) mutable {
      if (first) told.set_value(event.kind);
      first = false;
    });
    auto future = told.get_future();
    ASSERT_EQ(future.wait_for(5s), std::future_status::ready);
    EXPECT_EQ(future.get(), CarrierEvent::Kind::up);
  }
}

// Each has a loop and a thread of its own; the port at which hosts listen is one.
TEST(TwoBoards, OfOneProgramShareThePortAndGetWhatIsTheirs) {
  BoardInAThread left("udp");
  BoardInAThread right("udp");
  Board first(left.url());
  first.wait_active();
  const std::string listen = first.name().substr(first.name().find('?'));
  Board second(right.url().substr(0, right.url().find('?')) + listen);
  second.wait_active();
  first.send("C:rate,50");
  second.send("C:rate,20");
  EXPECT_EQ(left.executed().back(), "C:rate,50");
  EXPECT_EQ(right.executed().back(), "C:rate,20");
  first.stop();
  EXPECT_EQ(second.state().safe, SafeReason::none);
  EXPECT_EQ(problem_of([&] { Board again(first.name()); }).reason,
            "this program has that board open already");
}

TEST(BoardCallbacks, AreToldTheLinkAndTheNewestStateOfABoardThatIsSilentNow) {
  BoardInAThread simulated("udp");
  BoardOptions options;
  options.session.timing.timeout_ms = 50;
  Board board(simulated.url(), options);
  board.wait_active();
  std::promise<void> lost;
  board.on_link([&, done = false](const LinkStatus& link) mutable {
    if (done || link.state != HostLinkState::lost) return;
    done = true;
    lost.set_value();
  });
  simulated.switch_off();
  ASSERT_EQ(lost.get_future().wait_for(5s), std::future_status::ready);

  std::promise<LinkStatus> link;
  board.on_link([&](const LinkStatus& status) { link.set_value(status); });
  auto told_link = link.get_future();
  ASSERT_EQ(told_link.wait_for(5s), std::future_status::ready);
  EXPECT_EQ(told_link.get(), board.link());
  std::promise<std::uint32_t> state;
  board.on_state([&](const State& newest) { state.set_value(newest.t_ms); });
  auto told_state = state.get_future();
  ASSERT_EQ(told_state.wait_for(5s), std::future_status::ready);
  EXPECT_EQ(told_state.get(), board.state().t_ms);
}

TEST(BoardCallbacks, AreToldNoStateThatNeverCame) {
  Board board("udp://127.0.0.1:9?listen=0");
  std::atomic<bool> called{false};
  board.on_state([&](const State&) { called = true; });
  board.statistics();  // behind it
  EXPECT_FALSE(called);
}

}  // namespace
}  // namespace r4::test
