// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/control/loop.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <stdexcept>
#include <string>
#include <thread>

#include "r4link/error.hpp"
#include "r4link/simulation.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/problems.hpp"

namespace r4::control {
namespace {

using namespace std::chrono_literals;
using test::contains;
using test::problem_of;
using At = LoopGuard::Clock::time_point;

ReceivedState part(std::uint32_t t_ms, std::initializer_list<StateField> fields) {
  ReceivedState state;
  state.t_ms = t_ms;
  state.received = state.sampled = At(std::chrono::milliseconds(t_ms));
  for (const StateField each : fields) state.present.add(each);
  return state;
}

At at(std::uint32_t ms) { return At(std::chrono::milliseconds(ms)); }

LoopGuard begun(LoopOptions options) {
  LoopGuard guard(std::move(options));
  guard.start(at(1000));
  return guard;
}

TEST(LoopGuard, StepsOnceWhenAllFieldsOfAStateHaveCome) {
  LoopGuard guard = begun({.fields = "ENC1,AINSTEER"});
  const auto step = [&](const ReceivedState& state) {
    return guard.on_state(state, DisarmCause::none, state.received);
  };
  EXPECT_FALSE(step(part(1010, {StateField::enc1})));
  EXPECT_EQ(step(part(1010, {StateField::ainsteer})), 0.0);
  EXPECT_FALSE(step(part(1010, {StateField::enc1, StateField::ainsteer})))
      << "this state was handled before";
  EXPECT_FALSE(step(part(1020, {StateField::ainsteer})))
      << "the other field is from an earlier state";
  EXPECT_EQ(step(part(1030, {StateField::enc1, StateField::ainsteer})), 0.02);
}

TEST(LoopGuard, EndsForGoodWhenACompleteStateIsLate) {
  LoopGuard guard = begun({.fields = "ENC1", .late = 50ms});
  EXPECT_EQ(guard.deadline(), at(2000));
  guard.on_state(part(1010, {StateField::enc1}), DisarmCause::none, at(1015));
  EXPECT_EQ(guard.deadline(), at(1060));
  guard.on_state(part(1050, {StateField::safe}), DisarmCause::none, at(1055));
  EXPECT_EQ(guard.check(HostLinkState::active, DisarmCause::none, at(1059)), LoopEnd::none);
  EXPECT_EQ(guard.check(HostLinkState::active, DisarmCause::none, at(1060)), LoopEnd::late);
  EXPECT_TRUE(contains(guard.why(), "more than 50 ms ago with all of ENC1")) << guard.why();
  EXPECT_FALSE(guard.on_state(part(1061, {StateField::enc1}), DisarmCause::none, at(1061)));

  // A state that arrives, but too late.
  LoopGuard delayed = begun({.late = 50ms});
  EXPECT_FALSE(delayed.on_state(part(1010, {}), DisarmCause::none, at(1070)));
  EXPECT_EQ(delayed.ended(), LoopEnd::late);
  LoopGuard nothing = begun({.fields = "ENC1", .first = 300ms});
  EXPECT_EQ(nothing.check(HostLinkState::active, DisarmCause::none, at(1300)), LoopEnd::late);
  EXPECT_TRUE(contains(nothing.why(), "a state did not arrive within 300 ms")) << nothing.why();
}

TEST(LoopGuard, EndsWhenTheBoardIsSafeDisarmedLostOrRestarted) {
  LoopGuard safe = begun({});
  ReceivedState state = part(1010, {});
  state.safe = SafeReason::proximity;
  EXPECT_FALSE(safe.on_state(state, DisarmCause::proximity, at(1010)));
  EXPECT_EQ(safe.ended(), LoopEnd::not_active);
  EXPECT_TRUE(contains(safe.why(), "proximity"));
  LoopGuard disarmed = begun({});
  EXPECT_FALSE(disarmed.on_state(part(1010, {}), DisarmCause::supply, at(1010)));
  EXPECT_EQ(disarmed.ended(), LoopEnd::disarmed);
  LoopGuard lost = begun({});
  EXPECT_EQ(lost.check(HostLinkState::lost, DisarmCause::none, at(1001)), LoopEnd::not_active);

  LoopGuard again = begun({});
  again.on_state(part(1010, {}), DisarmCause::none, at(1010));
  ReceivedState other_boot = part(7, {});
  other_boot.received = other_boot.sampled = at(1020);
  EXPECT_FALSE(again.on_state(other_boot, DisarmCause::none, at(1020)));
  EXPECT_EQ(again.ended(), LoopEnd::not_active);
}

TEST(LoopGuard, EndsWhenADrivenMotorDoesNotTurn) {
  LoopOptions options;
  options.standstill = {{.encoder = 3, .drive = CommandKind::dhb12, .channel = 2, .time = 100ms}};
  LoopGuard guard = begun(options);
  std::uint32_t t_ms = 1000;
  std::int32_t counts = 0;
  const auto pass = [&](int states, std::int32_t counts_each) {
    while (states-- != 0 && guard.ended() == LoopEnd::none) {
      ReceivedState state = part(t_ms += 10, {StateField::enc3});
      state.raw.encoder_counts[2] = counts += counts_each;
      guard.on_state(state, DisarmCause::none, state.received);
    }
    return guard.ended();
  };
  EXPECT_EQ(pass(50, 0), LoopEnd::none) << "no output is driven";
  guard.on_commanded(Setpoints{Command::dhb12(2, Pwm(399), Direction::forward)});
  EXPECT_EQ(pass(50, 0), LoopEnd::none) << "the duty is too small to turn the motor";
  guard.on_commanded(Setpoints{Command::dhb12(2, Pwm(400), Direction::forward),
                               Command::dhb12(1, Pwm(0), Direction::forward)});
  EXPECT_EQ(pass(50, -1), LoopEnd::none) << "the wheel turns";
  EXPECT_EQ(pass(6, 0), LoopEnd::none);
  EXPECT_EQ(pass(50, 0), LoopEnd::standstill);
  EXPECT_TRUE(contains(guard.why(),
                       "ENC3 stands still, although DHB12 2 has been driven with 400 for 100 ms"))
      << guard.why();
}

TEST(LoopGuard, RefusesInvalidOptions) {
  EXPECT_TRUE(contains(problem_of([] { LoopGuard({.fields = "ENC9"}); }).reason, "ENC9"));
  EXPECT_THROW(LoopGuard({.late = 0ms}), Error);
  EXPECT_THROW(LoopGuard({.standstill = {{.encoder = 0}}}), Error);
  EXPECT_THROW(LoopGuard({.standstill = {{.channel = 5}}}), Error);
  EXPECT_THROW(LoopGuard({.standstill = {{.drive = CommandKind::servo}}}), Error);
}

// --- run_loop(), on a simulated board in this process

class RunLoop : public ::testing::Test {
 protected:
  explicit RunLoop(BoardOptions options = BoardOptions())
      : board(robot.url(), with_fields(options)) {
    loop.fields = "ENC1";
    loop.rest.add(Command::osmc(1, Pwm(0), Direction::forward));
    loop.late = 500ms;  // the machine may be busy
    board.wait_active();
    if (options.session.arming == Arming::required) board.arm();
  }
  static BoardOptions with_fields(BoardOptions options) {
    options.session.fields = "OSMC1,ENC1";
    return options;
  }
  static std::optional<Setpoints> drive(const LoopStep&) {
    return Setpoints{Command::osmc(1, Pwm(2000), Direction::forward)};
  }
  void expect_rest() const { EXPECT_EQ(robot.look().pins.osmc[0].pwm, 0); }

  sim::SimulatedRobot robot;
  Board board;
  LoopOptions loop;
};

TEST_F(RunLoop, RunsOnceAStateUntilTheStepEndsItAndStopsTheMotors) {
  double time_s = 0;
  std::int32_t counts = 0;
  const LoopReport report = run_loop(board, loop, [&](const LoopStep& step) {
    time_s += step.dt_s;
    counts = step.state.encoder(1);
    return time_s < 0.3 ? drive(step) : std::nullopt;
  });
  EXPECT_EQ(report.end, LoopEnd::asked);
  EXPECT_TRUE(report.at_rest) << report.why;
  EXPECT_GT(report.steps, 3U);
  EXPECT_GT(counts, 10);
  expect_rest();
  EXPECT_EQ(board.disarmed_by(), DisarmCause::none) << "another loop may begin";
}

TEST_F(RunLoop, StopsTheMotorsBeforeItRethrowsAnException) {
  EXPECT_THROW(run_loop(board, loop,
                        [&](const LoopStep& step) -> std::optional<Setpoints> {
                          if (step.state.encoder(1) > 5) throw std::runtime_error("no path");
                          return drive(step);
                        }),
               std::runtime_error);
  expect_rest();
}

TEST_F(RunLoop, StopsTheHeartbeatsWhenAStepHangs) {
  loop.watchdog = 50ms;
  bool safe = false;
  const LoopReport report = run_loop(board, loop, [&](const LoopStep& step) {
    if (step.state.encoder(1) > 5 && !safe) {
      // Waits until the board is safe. Only the watchdog can make it safe.
      for (int ms = 0; ms < 10'000 && !safe; ++ms) {
        std::this_thread::sleep_for(1ms);
        safe = robot.look().pins.is_safe();
      }
    }
    return drive(step);
  });
  EXPECT_TRUE(safe) << "the motor kept turning without control";
  EXPECT_NE(report.end, LoopEnd::asked);
  EXPECT_TRUE(robot.look().pins.is_safe());
}

struct RunLoopWithoutArming : RunLoop {
  RunLoopWithoutArming() : RunLoop(test::at_will()) {}
};

TEST_F(RunLoopWithoutArming, DrivesAndStopsTheMotors) {
  board.osmc(1).set_pwm(1000, Direction::forward);
  int steps = 0;
  const auto drive_four_times = [&](const LoopStep& step) {
    return ++steps < 5 ? drive(step) : std::nullopt;
  };
  // The loop requires an armed board. Otherwise the loop ends and leaves no output driven.
  const LoopReport untold = run_loop(board, loop, drive_four_times);
  EXPECT_EQ(untold.end, LoopEnd::disarmed);
  EXPECT_TRUE(contains(untold.why, "not yet; call arm() first")) << untold.why;
  EXPECT_TRUE(untold.at_rest);
  expect_rest();
  loop.arming = Arming::off;
  const LoopReport report = run_loop(board, loop, drive_four_times);
  EXPECT_EQ(report.end, LoopEnd::asked) << report.why;
  EXPECT_EQ(report.steps, 4U);
  expect_rest();
}

TEST(RunLoopOnACutLink, ReportsThatTheMotorsMayStillRun) {
  sim::SimulatedRobot robot;
  BoardOptions options;
  options.session.fields = "OSMC1,ENC1";
  Board board(sim::with_link(robot.url(), "cut=1s+30s"), options);
  board.wait_active();
  board.arm();
  LoopOptions loop;
  loop.fields = "ENC1";
  loop.late = 300ms;
  loop.rest_timeout = 50ms;
  loop.rest.add(Command::osmc(1, Pwm(0), Direction::forward));
  const LoopReport report = run_loop(board, loop, [](const LoopStep&) {
    return std::optional(Setpoints{Command::osmc(1, Pwm(2000), Direction::forward)});
  });
  EXPECT_EQ(report.end, LoopEnd::late) << report.why;
  EXPECT_FALSE(report.at_rest);
  EXPECT_TRUE(contains(report.why, std::string(stop_last_resort))) << report.why;
}

TEST_F(RunLoop, NeedsSetpointsForRest) {
  loop.rest = Setpoints();
  EXPECT_TRUE(contains(problem_of([&] { run_loop(board, loop, drive); }).thing, "rest"));
}

}  // namespace
}  // namespace r4::control
