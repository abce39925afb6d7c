// SPDX-License-Identifier: GPL-3.0-or-later
// A program streams setpoints to a simulated board in real time. No motor may start by itself.
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "r4link/board.hpp"
#include "r4link/error.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/board_in_a_thread.hpp"
#include "tests/support/first.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;
using firmware::BoardState;

// Posts a setpoint every 2 ms, like teleop, until the end of the test.
class Stream {
 public:
  explicit Stream(Board& board)
      : thread_([this, &board] {
          while (!ended_) {
            last_ = board.post(Command::osmc(1, Pwm(500), Direction::forward)).value();
            ++turns_;
            turns_.notify_one();
            std::this_thread::sleep_for(2ms);
          }
        }) {}
  ~Stream() {
    ended_ = true;
    thread_.join();
  }
  // The result of the last of 100 posts.
  PostResult::Value later() {
    const int last = turns_ + 100;
    for (int turns = turns_; turns < last; turns = turns_) turns_.wait(turns);
    return last_;
  }

 private:
  std::atomic<bool> ended_{false};
  std::atomic<int> turns_{0};
  std::atomic<PostResult::Value> last_{PostResult::no_link};
  std::thread thread_;
};

int driven(Board& board) { return board.next_state().osmc(1).pwm; }

TEST(BoardArming, AStreamOfPostsDoesNotStartMotorsAfterAClearedStop) {
  BoardInAThread simulated("udp");
  Board board(simulated.url());
  board.wait_active();
  Stream stream(board);
  EXPECT_EQ(stream.later(), PostResult::not_armed);
  EXPECT_EQ(driven(board), 0);
  board.arm();
  EXPECT_EQ(stream.later(), PostResult::sent);
  EXPECT_EQ(driven(board), 500);
  Board(simulated.url()).stop();
  ASSERT_TRUE(hears_of(board, SafeReason::stop));
  board.send(Command::clear());
  board.wait_active();
  EXPECT_EQ(stream.later(), PostResult::not_armed);
  EXPECT_EQ(board.disarmed_by(), DisarmCause::stop);
  EXPECT_EQ(driven(board), 0);
  board.arm();
  EXPECT_EQ(stream.later(), PostResult::sent);
  EXPECT_EQ(driven(board), 500);
}

TEST(BoardArming, NamesTheCauseThatPreventsArming) {
  BoardInAThread simulated("pty", "0 handle released\n");
  Board board(simulated.url());
  const Problem arming = problem_of([&] { board.arm(); });
  EXPECT_EQ(arming.kind, ErrorKind::refused);
  EXPECT_EQ(
      arming.text(),
      "arm(): not armed: the dead-man's handle was released; hold the handle, then call arm()");
  EXPECT_EQ(problem_of([&] { board.osmc(1).set_pwm(1, Direction::forward); }).reason,
            arming.reason);
}

TEST(BoardArming, CountsRefusedPostsAndReportsThoseTheBoardRefuses) {
  BoardInAThread simulated("pty");
  Board guarded(simulated.url(), at_will());
  const First<RefusedPost> refused;
  guarded.on_refused([refused](const RefusedPost& post) { refused.set(post); });
  guarded.wait_active();
  guarded.stop();
  ASSERT_TRUE(guarded.post(Command::osmc(1, Pwm(5), Direction::forward)));
  const RefusedPost post = refused.get();
  EXPECT_EQ(post.command.value, 5);
  EXPECT_EQ(post.code, Refusal::safe);
  EXPECT_EQ(guarded.statistics().refused, 1U);

  Board board("sim:");
  board.wait_active();
  EXPECT_EQ(board.post(Command::osmc(1, Pwm(5), Direction::forward)), PostResult::not_armed);
  EXPECT_EQ(board.statistics().refused, 1U);
}

}  // namespace
}  // namespace r4::test
