// SPDX-License-Identifier: GPL-3.0-or-later
// r4::Board with simulated boards in real time: in process, over UDP and over a pty.
#include "r4link/board.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <thread>
#include <vector>

#include "r4link/error.hpp"
#include "tests/bench/allocations.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/board_in_a_thread.hpp"
#include "tests/support/driven_board.hpp"
#include "tests/support/every_channel.hpp"
#include "tests/support/first.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;
using firmware::BoardState;

// --- every transport

struct BoardOver : testing::TestWithParam<const char*> {
  BoardInAThread simulated{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Transports, BoardOver, testing::Values("udp", "pty"),
                         [](const auto& transport) { return std::string(transport.param); });

TEST_P(BoardOver, ConfirmsEveryCommandAfterItsExecution) {
  Board board(simulated.url(), at_will());
  board.wait_active();
  board.setting("rate", "1000");
  board.osmc(1).set_pwm(358, Direction::forward);
  board.osmc(4).set(-1);
  board.dhb12(2).set_pwm(100, Direction::forward);
  board.servo(16).set(Microseconds(1500));
  board.relay(3).set(true);
  board.stepper(2).move_to(Steps(-5), StepsPerSecond(20000));
  board.bldc(4).set_pwm(2000, Direction::forward, true);
  board.dhb12(1).post(-0.25);
  board.osmc(2).post_pwm(7, Direction::reverse);
  board.bldc(1).post_pwm(8, Direction::reverse, true);
  board.bldc(2).post(-1, true);
  board.bldc(3).set(-0.25);
  board.proximity(1, Centimetres(15));
  board.stepper(1).zero();
  board.setting("recovery", "rearm");
  board.send("S:0,16");
  const std::vector<std::string> after_settings{
      "O:358,1,1",    "O:4095,0,4", "D:100,1,2",        "S:1500,16", "R:3,On",       "P:-5,20000,2",
      "B:2000,1,1,4", "D:1024,0,1", "O:7,0,2",          "B:8,0,1,1", "B:4095,0,1,2", "B:1024,0,0,3",
      "U:15,1",       "Z:1",        "C:recovery,rearm", "S:0,16"};
  std::vector<std::string> executed = simulated.executed();
  ASSERT_GE(executed.size(), after_settings.size());
  executed.erase(executed.begin(), executed.end() - static_cast<long>(after_settings.size()));
  EXPECT_EQ(executed, after_settings) << "each command must be executed once, in order";
}

TEST_F(DrivenBoard, SetsThePinOfEveryChannelAndReadsItBack) {
  expect_every_channel(controlled(simulated, board));
}

TEST(BoardAtACable, KeepsAWiringForItsNextStart) {
  BoardInAThread simulated("pty");
  Board board(simulated.url(), at_will());
  board.wait_active();
  BoardWiring kept = board.wiring();
  EXPECT_EQ(kept.source, WiringSource::plan);
  EXPECT_TRUE(kept.in_use);
  EXPECT_EQ(kept.wiring, plan_wiring());
  Wiring wiring = plan_wiring();
  wiring.at(SignalKind::handle).byte = 53;
  board.give_wiring(wiring);
  kept = board.wiring();
  EXPECT_EQ(kept.source, WiringSource::given);
  EXPECT_FALSE(kept.in_use);
  EXPECT_EQ(kept.wiring, wiring);
  wiring.at(SignalKind::handle).byte = 20;
  EXPECT_THROW(board.give_wiring(wiring), Error);
  EXPECT_EQ(board.wiring().wiring.at(SignalKind::handle).number(), 53);
  EXPECT_EQ(board.identify().wiring->source, WiringSource::given) << "the newest answer";
}

TEST_P(BoardOver, StopsUntilCleared) {
  Board board(simulated.url(), at_will());
  board.wait_active();
  board.osmc(1).set_pwm(1000, Direction::forward);
  board.stop();
  EXPECT_TRUE(simulated.wait_for(BoardState::safe, SafeReason::stop));
  EXPECT_EQ(board.link(), (LinkStatus{.state = HostLinkState::safe,
                                      .reason = SafeReason::stop,
                                      .in_control = true,
                                      .carrying = 1}));

  const Problem refused = problem_of([&] { board.osmc(1).set_pwm(5, Direction::forward); });
  EXPECT_EQ(refused.kind, ErrorKind::refused);
  EXPECT_EQ(refused.thing, "O:5,1,1");
  EXPECT_TRUE(contains(refused.reason, "SAFE"));
  EXPECT_TRUE(contains(refused.reason, "emergency stop"));
  EXPECT_TRUE(contains(refused.fix, "E:CLEAR"));

  board.send(Command::clear());
  board.wait_active();
  EXPECT_EQ(board.next_state().osmc(1).pwm, 0) << "no output may come back after a stop";
  board.osmc(1).set_pwm(5, Direction::forward);
}

TEST_P(BoardOver, TheBoardGoesSafeWhenTheApplicationHangs) {
  Board board(simulated.url(), at_will());
  board.setting("heartbeat", "50");
  board.setting("timeout", "150");
  board.watchdog(100ms);
  const First<bool> gated;
  board.on_link([gated](const LinkStatus& link) {
    if (link.gated()) gated.set(true);
  });
  ASSERT_TRUE(gated.get());
  EXPECT_TRUE(simulated.wait_for(BoardState::safe, SafeReason::link));
  const Problem problem = problem_of([&] { board.wait_active(50ms); });
  EXPECT_TRUE(contains(problem.reason, "watchdog"));
  EXPECT_TRUE(contains(problem.fix, "feed()"));
  while (board.link().gated()) board.feed();
  board.watchdog(0ms);
  board.wait_active();
}

TEST_P(BoardOver, TheBoardIsSafeAndFreeWhenTheHostHasEnded) {
  for (int i = 0; i < 3; ++i) {
    Board board(simulated.url(), at_will());
    board.setting("timeout", "10000");  // much longer than any wait below
    board.osmc(1).set_pwm(100, Direction::forward);
    board.close();
    EXPECT_TRUE(simulated.is_without_host()) << "the board must be safe before close() returns";
  }
}

TEST(Board, ReportsARestartBeforeTheNewState) {
  BoardInAThread simulated("pty", "0.5 reboot\n");
  std::vector<int> duties;  // duties of OSMC 1, in the order of the callbacks; -1 marks the restart
  const First<std::vector<int>> four;
  Board board(simulated.url(), at_will());
  board.on_restart([&] { duties.push_back(-1); });
  board.on_state([&, four](const State& state) {
    if (!state.present.has(StateField::osmc1)) return;
    const int duty = state.osmc(1).pwm;
    if (!duties.empty() && duties.back() == duty) return;
    duties.push_back(duty);
    if (duties.size() == 4) four.set(duties);
  });
  board.fields("OSMC1");
  board.osmc(1).set_pwm(358, Direction::forward);
  EXPECT_EQ(four.get(), (std::vector<int>{0, 358, -1, 0}));
}

TEST(Board, ErrorsNameTheReasonOfAnInactiveLink) {
  Board board("udp://127.0.0.1:9?listen=0", at_will());
  const Problem nobody = problem_of([&] { board.wait_active(30ms); });
  EXPECT_EQ(nobody.kind, ErrorKind::refused);
  EXPECT_EQ(nobody.thing, board.name());
  EXPECT_TRUE(contains(nobody.reason, "nothing was received"));
  const Problem command = problem_of([&] { board.osmc(1).set_pwm(1, Direction::forward, 30ms); });
  EXPECT_EQ(command.thing, "O:1,1,1");
  EXPECT_TRUE(contains(command.reason, "not confirmed within "));
  EXPECT_TRUE(contains(command.reason, "nothing was received"));
  EXPECT_TRUE(contains(problem_of([&] { board.next_state(30ms); }).reason, "nothing was received"));
  EXPECT_TRUE(contains(problem_of([&] { board.identify(30ms); }).reason, "not confirmed"));
  EXPECT_TRUE(contains(problem_of([&] { board.stop(30ms); }).reason, "not confirmed"));
  EXPECT_FALSE(board.post(Command::osmc(1, Pwm(1), Direction::forward)));
}

TEST_F(DrivenBoard, PostsCommandsAndGroupsAndWaitsForStatesWithoutTheHeap) {
  board.osmc(1).set_pwm(1, Direction::forward);
  board.identify();  // the answer reports that the board executes groups
  int sent = 0;
  const std::uint64_t before = bench::allocations_of_this_thread();
  for (int i = 0; i < 20; ++i) {
    if (board.post(Command::osmc(1, Pwm(100 + i), Direction::forward))) ++sent;
    const Direction forward = Direction::forward;
    if (board.post(Setpoints{Command::osmc(1, Pwm(100 + i), forward),
                             Command::osmc(2, Pwm(100 + i), forward)}))
      ++sent;
    board.next_state();
  }
  EXPECT_EQ(bench::allocations_of_this_thread() - before, 0U);
  EXPECT_EQ(sent, 40);
}

// --- commands

TEST_F(DrivenBoard, RefusesToSendSecretsExceptOverACable) {
  const std::string secret = "1:" + std::string(2 * key_size, 'e');
  for (const Problem& problem :
       {problem_of([&] { board.setting("key", secret); }),
        problem_of([&] { board.setting("password", "eeeeeeee"); }),
        problem_of([&] { board.post(Command::setting("key", Text(secret))); })}) {
    EXPECT_EQ(problem.kind, ErrorKind::usage);
    EXPECT_TRUE(contains(problem.reason, "over USB only")) << problem.reason;
    EXPECT_FALSE(contains(problem.thing, "eee")) << problem.thing;
  }
}

TEST(Board, ThrowsForAValueOutsideItsRangeAndNamesTheRange) {
  Board board("sim:", at_will());
  const auto is_usage = [](auto action) {
    const Problem problem = problem_of(action);
    EXPECT_EQ(problem.kind, ErrorKind::usage) << problem.text();
    EXPECT_FALSE(problem.fix.empty()) << problem.text();
    EXPECT_FALSE(problem.thing.empty()) << problem.text();
  };
  is_usage([&] { board.osmc(5).set(0.1); });
  is_usage([&] { board.osmc(1).set(1.01); });
  is_usage([&] { board.bldc(1).post(-1.01); });
  is_usage([&] { board.osmc(-1).set_pwm(1, Direction::forward); });
  is_usage([&] { board.osmc(257).set_pwm(1, Direction::forward); });
  is_usage([&] { board.fields("AIN24,AIN99"); });
  is_usage([&] { board.send("O:1,1"); });
  is_usage([&] { board.send("osmc 1"); });
  is_usage([&] { board.post(Command::osmc(1, Pwm(5000), Direction::forward)); });
  EXPECT_EQ(
      problem_of([&] { board.osmc(5).set_pwm(1, Direction::forward); }).text(),
      "O:1,1,5: the channel does not exist; use O:pwm,dir,ch with pwm 0-4095, dir 0 or 1, ch 1-4");
  EXPECT_EQ(board.statistics().refused, 0U) << "an invalid command must not be sent";
}

TEST_F(DrivenBoard, StopsWithoutWaiting) {
  board.stop_async();
  EXPECT_TRUE(simulated.wait_for(BoardState::safe, SafeReason::stop));
}

TEST_F(DrivenBoard, TakesCommandsFromSeveralThreadsAtOnce) {
  board.setting("rate", "1000");
  std::atomic<int> confirmed{0};
  std::vector<std::thread> threads;
  for (int channel = 1; channel <= 4; ++channel) {
    threads.emplace_back([&, channel] {
      for (int i = 0; i < 50; ++i) {
        board.osmc(channel).set_pwm(i, Direction::forward, 5s);
        board.post(Command::servo(channel, Microseconds(i)));
        static_cast<void>(board.state());
        static_cast<void>(board.link());
        static_cast<void>(board.statistics());
        board.feed();
        ++confirmed;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(confirmed, 200);
  const State state = board.next_state();
  EXPECT_EQ(state.osmc(1).pwm, 49);
}

// --- callbacks

TEST(Board, AllowsBlockingCallsInACallback) {
  Board board("sim:", at_will());
  const First<std::string> end;
  board.on_state([&, end, done = false](const State&) mutable {
    if (std::exchange(done, true)) return;
    const Problem problem = problem_of([&] {
      board.wait_active();
      board.osmc(1).set_pwm(1, Direction::forward);
      board.next_state();
      board.identify();
      static_cast<void>(board.state());
      static_cast<void>(board.statistics());
      board.watchdog(0ms);
      board.post(Command::servo(1, Microseconds(1)));
      board.stop();
      throw Error(ErrorKind::usage, "all", "is done");
    });
    end.set(problem.text());
  });
  EXPECT_EQ(end.get(), "all: is done");
}

// --- the end

TEST(Board, MayBeClosedTwiceAndRefusesLaterCalls) {
  Board board("sim:", at_will());
  board.wait_active();
  board.close();
  board.close();
  EXPECT_TRUE(
      contains(problem_of([&] { board.osmc(1).set_pwm(1, Direction::forward); }).reason, "closed"));
  EXPECT_TRUE(contains(problem_of([&] { board.wait_active(); }).reason, "closed"));
  EXPECT_TRUE(contains(problem_of([&] { board.next_state(); }).reason, "closed"));
  EXPECT_FALSE(board.post(Command::servo(1, Microseconds(1))));
  board.on_state([](const State&) {});
  board.watchdog(10ms);
  board.feed();
  board.stop_async();
  EXPECT_NE(board.state().t_ms, 0U) << "the last state stays available";
  EXPECT_NE(board.statistics().states, 0U) << "the statistics stay available";
}

TEST(Board, CloseEndsAllWaitingCalls) {
  for (const bool destroyed : {false, true}) {
    auto board = std::make_unique<Board>("udp://127.0.0.1:9?listen=0", at_will());
    std::atomic<int> begun{0};
    std::vector<std::future<std::string>> waiting;
    const auto wait = [&](auto call) {
      waiting.push_back(std::async(std::launch::async, [&, call, raw = board.get()] {
        ++begun;
        return problem_of([&] { call(*raw); }).reason;
      }));
    };
    wait([](Board& each) { each.osmc(1).set_pwm(1, Direction::forward, 60s); });
    wait([](Board& each) { each.identify(60s); });
    wait([](Board& each) { each.wait_active(60s); });
    wait([](Board& each) { each.next_state(60s); });
    while (begun < 4) std::this_thread::yield();
    EXPECT_EQ(waiting[0].wait_for(50ms), std::future_status::timeout);
    if (destroyed) {
      board.reset();
    } else {
      board->close();
    }
    for (auto& each : waiting) {
      ASSERT_EQ(each.wait_for(5s), std::future_status::ready);
      EXPECT_TRUE(contains(each.get(), "closed"));
    }
  }
}

TEST(Board, MayBeDestroyedInACallback) {
  auto board = std::make_unique<Board>("sim:", at_will());
  const First<bool> destroyed;
  // This object is destroyed in the thread of the board's callbacks, which must also end.
  struct AtThreadExit {
    First<bool> ended;
    ~AtThreadExit() { ended.set(true); }
  };
  board->on_state([&](const State&) {
    thread_local AtThreadExit end{destroyed};
    board.reset();
  });
  EXPECT_TRUE(destroyed.get());
}

TEST(Board, OpensAndClosesAtAnyMoment) {
  for (int i = 0; i < 30; ++i) {
    Board board("sim:", at_will());
    if (i % 3 == 1) board.stop_async();
    if (i % 3 == 2) board.wait_active();
  }
}

}  // namespace
}  // namespace r4::test
