// SPDX-License-Identifier: GPL-3.0-or-later
// The order of states: which states wait, and which states are replaced. If the user wants every
// state, gaps are reported.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <future>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "host/state_queue.hpp"
#include "r4link/board.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

struct RecordedNumbers : RecordingVisitor {
  void on_record(const Record& record) override {
    if (const State* const state = states.take(record)) numbers.push_back(state->pnum);
  }
  void on_damage(const RecordingDamage& damage) override { ADD_FAILURE() << damage.reason; }
  RecordedStates states;
  std::vector<std::uint32_t> numbers;
};

std::vector<std::uint32_t> numbers_of(States& states) {
  std::vector<std::uint32_t> numbers;
  while (const auto state = states.take(0ms)) numbers.push_back(state->pnum);
  return numbers;
}

TEST(BoardStates, AreCompleteWhileACallbackAndTheLoopSleep) {
  const std::string path = testing::TempDir() + "r4-states-" + std::to_string(::getpid());
  BoardOptions options = at_will();
  options.callback_limit = 0ms;
  Board board("sim:", options);
  board.record(path);
  board.wait_active();
  std::promise<void> wake;
  board.on_state([asleep = wake.get_future().share()](const ReceivedState&) { asleep.wait(); });
  States states = board.states({.lossless = true});
  for (int i = 0; i < 40; ++i) board.next_state();
  wake.set_value();
  board.close();
  const std::vector<std::uint32_t> taken = numbers_of(states);
  EXPECT_TRUE(states.ended());
  EXPECT_EQ(states.missed(), 0);
  ASSERT_GE(taken.size(), 40);
  RecordedNumbers recorded;
  read_recording(path, recorded);
  std::filesystem::remove(path);
  auto& all = recorded.numbers;
  all.erase(all.begin(), std::find(all.begin(), all.end(), taken.front()));
  ASSERT_GE(all.size(), taken.size());
  all.resize(taken.size());
  EXPECT_EQ(taken, all);
}

TEST(BoardStates, EndWithTheBoardAndMayBeUsedAfterIt) {
  std::optional<Board> board("udp://127.0.0.1:9?listen=0");
  States states = board->states();
  EXPECT_FALSE(states.take(1ms)) << "the board has sent no state";
  EXPECT_FALSE(states.ended());
  auto waiting = std::async(std::launch::async, [&] { return states.take(60s); });
  EXPECT_EQ(waiting.wait_for(20ms), std::future_status::timeout);
  board->close();
  EXPECT_FALSE(waiting.get());
  EXPECT_TRUE(board->states().ended());
  board.reset();
  EXPECT_TRUE(states.ended());
  EXPECT_FALSE(states.take(60s));
}

// Compares with a deque, for any order of puts and takes.
TEST(BoardStates, ComeInOrderAndReportEachGapOnce) {
  for (std::uint32_t seed = 0; seed < 40; ++seed) {
    std::mt19937 random(seed);
    const bool lossless = seed % 2 == 0;
    const std::size_t most = random() % 40;
    const std::size_t room = most != 0 ? most : lossless ? 65536 : 1;
    States::Queue queue({.lossless = lossless, .most = most}, nullptr);
    std::deque<std::uint32_t> model;
    std::uint64_t gap = 0;
    std::uint64_t missed = 0;
    const unsigned puts = 1 + random() % 4;
    for (std::uint32_t pnum = 0; pnum < 200;) {
      if (random() % 5 < puts) {
        ReceivedState state;
        state.pnum = pnum++;
        queue.put(state);
        if (lossless && (gap > 0 || model.size() == room)) {
          ++gap;
          ++missed;
          continue;
        }
        if (model.size() == room) {
          model.pop_front();
          ++missed;
        }
        model.push_back(state.pnum);
      } else if (!model.empty()) {
        const auto state = queue.take(0ms);
        ASSERT_TRUE(state) << seed;
        ASSERT_EQ(state->pnum, model.front()) << seed;
        model.pop_front();
      } else if (gap > 0) {
        const Problem problem = problem_of([&] { queue.take(0ms); });
        ASSERT_EQ(problem.kind, ErrorKind::data) << seed;
        EXPECT_TRUE(contains(problem.reason, "the queue of " + std::to_string(room)));
        EXPECT_TRUE(contains(problem.reason, "the next " + std::to_string(gap)));
        gap = 0;
      } else {
        ASSERT_FALSE(queue.take(0ms)) << seed;
      }
      ASSERT_EQ(queue.missed(), missed) << seed;
    }
  }
}

}  // namespace
}  // namespace r4::test
