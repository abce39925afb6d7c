// SPDX-License-Identifier: GPL-3.0-or-later
// The host's estimate of the board's clock, compared with the true clock of the test.
#include "host/measurement/board_clock.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <random>

namespace r4 {
namespace {

using namespace std::chrono_literals;

// A board, a link with a random delay in each direction, and a host that sends questions, in
// virtual time.
struct ClockBench {
  struct Options {
    double drift_ppm = 0;  // how much slower the board's clock is
    double least_us = 100, most_us = 300;
    double least_back_us = -1, most_back_us = -1;  // from the board to the host; -1: the same delay
    unsigned seed = 1;
  };

  explicit ClockBench(const Options& of) : options(of), random(of.seed) {
    offset_us = std::uniform_real_distribution<>(1e6, 9e6)(random);
  }

  double board_us(double host_us) const {
    return (host_us - offset_us) * (1 - options.drift_ppm * 1e-6);
  }
  double host_us(double board_us) const {
    return board_us / (1 - options.drift_ppm * 1e-6) + offset_us;
  }
  double delay(bool back) {
    const bool other = back && options.least_back_us >= 0;
    const double least = other ? options.least_back_us : options.least_us;
    const double most = other ? options.most_back_us : options.most_us;
    return std::uniform_real_distribution<>(least, most)(random);
  }
  static std::uint32_t shown(double board_us) {
    return first_t + static_cast<std::uint32_t>(static_cast<std::int64_t>(board_us / 1000));
  }
  static Time time(double us) { return Time{static_cast<std::int64_t>(us)}; }

  // Delivers a state that was sampled at this time of the board. Returns its error in us.
  double state(int board_ms) {
    const double sent = host_us(board_ms * 1000.0);
    clock.heard(first_t + static_cast<std::uint32_t>(board_ms), time(sent + delay(true)));
    const auto instant = clock.at(first_t + static_cast<std::uint32_t>(board_ms));
    const double error = static_cast<double>(instant.at.count()) - sent;
    ++states;
    bounded += instant.error.has_value();
    if (instant.error) bound_us = static_cast<double>(instant.error->count());
    honest += instant.error && std::abs(error) <= bound_us + 1;
    return error;
  }
  void question(double board_ms) {
    const double sent = host_us(board_ms * 1000.0);
    const double came = sent + delay(false);
    const std::uint32_t t_ms = shown(board_us(came));
    clock.heard(t_ms, time(came + delay(true)));
    clock.answered(t_ms, time(sent));
  }
  // States at 100 Hz, and questions as a session sends them. Returns the greatest error after
  // `settled_ms`.
  double run(int from_ms, int to_ms, int settled_ms) {
    double worst = 0;
    for (int ms = from_ms; ms < to_ms; ms += 10) {
      while (next_question < ms) {
        question(next_question);
        next_question += bound_us <= (asked < 100 ? 500 : 1000) ? 1000 : 102.3;
        ++asked;
      }
      const double error = state(ms);
      if (ms >= settled_ms) worst = std::max(worst, std::abs(error));
    }
    return worst;
  }

  static constexpr std::uint32_t first_t = 0xffffff00U;  // wraps soon
  Options options;
  std::mt19937 random;
  double offset_us;
  BoardClock clock;
  double next_question = 5;
  int asked = 0;
  int states = 0, bounded = 0, honest = 0;
  double bound_us = 1e9;
};

TEST(BoardClock, UsesTheFastestDatagramWithoutAnAnswer) {
  BoardClock clock;
  clock.heard(1000, 5s + 7ms);
  EXPECT_EQ(clock.at(1000).at, 5s + 7ms);
  EXPECT_FALSE(clock.at(1000).error);
  clock.heard(1010, 5s + 12ms);
  EXPECT_NEAR(static_cast<double>(clock.at(1020).at.count()), 5'022'000, 2);
  clock.heard(1020, 5s + 100ms);
  EXPECT_NEAR(static_cast<double>(clock.at(1020).at.count()), 5'022'000, 3)
      << "a delayed state must not move the clock";
}

TEST(BoardClock, ARoundTripGivesAnErrorBound) {
  BoardClock clock;
  clock.heard(1000, 5s);
  clock.answered(1000, 4999ms);
  ASSERT_TRUE(clock.at(1000).error);
  EXPECT_EQ(clock.at(1000).at, 4999ms)
      << "the middle of 4998 (the question, less 1 ms of T) and 5000";
  EXPECT_NEAR(static_cast<double>(clock.at(1000).error->count()), 1000, 2);
}

// For every seed and drift, the clock is at least this exact, and its error is within the reported
// error.
void expect_exact(ClockBench::Options options, int until_ms, int settled_ms, double error_us,
                  double bound_us) {
  for (options.seed = 1; options.seed <= 200; ++options.seed) {
    options.drift_ppm = static_cast<double>(options.seed % 201) - 100;
    ClockBench bench(options);
    EXPECT_LE(bench.run(0, until_ms, settled_ms), error_us) << "seed " << options.seed;
    EXPECT_EQ(bench.honest, bench.bounded) << "seed " << options.seed;
    EXPECT_GE(bench.bounded, bench.states - 20) << "seed " << options.seed;
    EXPECT_LE(bench.bound_us, bound_us) << "seed " << options.seed;
  }
}

TEST(BoardClock, IsWithinSevenTenthsOfAMillisecondOnAFastPath) {
  expect_exact({}, 20'000, 2'000, 700, 1'000);
}

// A question takes one frame to the board. A state takes many frames to the host, after the states
// of seven other boards (docs/how-to/can.md).
TEST(BoardClock, IsWithinSevenTenthsOfAMillisecondOnALoadedCanBus) {
  expect_exact({.least_us = 150, .most_us = 600, .least_back_us = 700, .most_back_us = 2'800},
               20'000, 10'000, 700, 1'500);
}

TEST(BoardClock, IsWithin2MsAfter10SecondsWithDelaysUpTo20Ms) {
  expect_exact({.least_us = 0, .most_us = 20'000}, 60'000, 10'000, 2'000, 20'000);
}

TEST(BoardClock, ErrorBoundCoversALinkThatIsSlowerInOneDirection) {
  ClockBench bench(
      {.least_us = 100, .most_us = 300, .least_back_us = 30'000, .most_back_us = 30'200});
  EXPECT_GE(bench.run(0, 20'000, 10'000), 10'000)
      << "no estimate can detect different delays of the two directions";
  EXPECT_EQ(bench.honest, bench.bounded);
}

TEST(BoardClock, MeasuresTheDriftWithinItsError) {
  ClockBench bench({.drift_ppm = 60});
  bench.run(0, 40'000, 0);
  EXPECT_NEAR(bench.clock.drift_ppm(), 60, bench.clock.drift_error_ppm());
  EXPECT_LE(bench.clock.drift_error_ppm(), 40);
}

TEST(BoardClock, ErrorBoundGrowsDuringAnOutageAndStaysTrue) {
  ClockBench bench({.drift_ppm = -80});
  bench.run(0, 10'000, 0);
  const double before = bench.bound_us;
  bench.next_question = 35'000;
  bench.state(30'000);
  EXPECT_GT(bench.bound_us, before);
  EXPECT_LE(bench.bound_us, 4000);
  bench.run(30'010, 40'000, 0);
  EXPECT_EQ(bench.honest, bench.bounded);
}

TEST(BoardClock, FollowsAClockThatWasSet) {
  for (const Time step : {Time{5s}, Time{-5s}}) {  // the host slept, or the board's clock was set
    BoardClock clock;
    clock.heard(1000, 100s);
    clock.answered(1000, 100s - 1ms);
    clock.heard(2000, 101s + step);
    clock.answered(2000, 101s + step - 1ms);
    clock.heard(2010, 101s + step + 10ms);
    ASSERT_TRUE(clock.at(2000).error);
    EXPECT_LE(*clock.at(2000).error, 1002us);
    EXPECT_LE(std::abs((clock.at(2000).at - 101s - step).count()), 1000);
  }
}

TEST(BoardClock, IsNotDisturbedByLateOrReorderedDatagrams) {
  ClockBench bench({.drift_ppm = 30});
  bench.run(0, 5'000, 0);
  const auto before = bench.clock.at(ClockBench::shown(5e6));
  bench.clock.heard(ClockBench::shown(1e6), ClockBench::time(bench.host_us(5e6)));
  bench.clock.answered(ClockBench::shown(4.9e6), ClockBench::time(bench.host_us(1e6)));
  EXPECT_EQ(bench.clock.at(ClockBench::shown(5e6)).at, before.at);
  bench.run(5'000, 10'000, 0);
  EXPECT_EQ(bench.honest, bench.bounded);
}

}  // namespace
}  // namespace r4
