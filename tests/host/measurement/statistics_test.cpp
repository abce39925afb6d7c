// SPDX-License-Identifier: GPL-3.0-or-later
#include "host/measurement/statistics.hpp"

#include <gtest/gtest.h>

#include "tests/host/session/scripted_link.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;
using Micros = std::chrono::microseconds;

TEST(Statistics, RateCoversTheLastSecond) {
  StatisticsCollector collector;
  Micros now = 500s + 12345us;
  std::uint32_t t = 0;
  for (int i = 0; i < 10; ++i, now += 10ms, t += 10) collector.on_state(t, now);
  EXPECT_NEAR(collector.report(now).state_rate_hz, 100, 5) << "after a tenth of a second";
  for (int i = 0; i < 290; ++i, now += 10ms, t += 10) collector.on_state(t, now);
  EXPECT_NEAR(collector.report(now).state_rate_hz, 100, 2);
  for (int i = 0; i < 2000; ++i, now += 1ms, t += 1) collector.on_state(t, now);
  EXPECT_NEAR(collector.report(now).state_rate_hz, 1000, 20);
  now += 500ms;
  EXPECT_NEAR(collector.report(now).state_rate_hz, 500, 60);
  now += 1s;
  EXPECT_EQ(collector.report(now).state_rate_hz, 0);
}

// RFC 3550, 6.4.1: J += (|D| - J) / 16. D is the difference between the transit times of two
// successive states.
TEST(Statistics, JitterFollowsRfc3550) {
  StatisticsCollector even;
  Micros now = 500s;
  std::uint32_t t = 0xffffff00U;  // wraps
  for (int i = 0; i < 100; ++i, now += 10ms, t += 10) even.on_state(t, now);
  EXPECT_EQ(even.report(now).jitter_us, 0);

  StatisticsCollector uneven;
  now = 500s;
  double expected = 0;
  for (std::uint32_t i = 0; i < 200; ++i) {
    const Micros delay = i % 2 == 0 ? 0us : 3000us;
    uneven.on_state(i * 10, now + delay);
    if (i > 0) expected += (3000 - expected) / 16;
    now += 10ms;
  }
  EXPECT_DOUBLE_EQ(uneven.report(now).jitter_us, expected);
  EXPECT_NEAR(expected, 3000, 1);
}

TEST(Statistics, AgeBelongsToTheNewestState) {
  StatisticsCollector collector;
  EXPECT_EQ(collector.report(500s).state_age_us, 0) << "there is no state yet";
  collector.on_state(0, 500s);
  collector.on_state(10, 500s + 10ms);
  EXPECT_EQ(collector.report(500s + 17ms).state_age_us, 7000);
}

TEST(Statistics, RoundTripHasNewestMinimumAndMean) {
  StatisticsCollector collector;
  for (const Micros each : {300us, 100us, 200us}) collector.on_round_trip(each);
  const Statistics report = collector.report(1s);
  EXPECT_EQ(report.round_trip_us, 200);
  EXPECT_EQ(report.round_trip_min_us, 100);
  EXPECT_EQ(report.round_trip_mean_us, 200);
}

TEST(Statistics, LossIsAShareOfTheBoardDatagrams) {
  ConnectedLink link;
  for (int i = 0; i < 100; ++i) {
    link.pass(10ms);
    if (i % 4 == 3) ++link.board_pnum;  // one in five datagrams is lost
    link.executed(1);
  }
  EXPECT_EQ(Statistics().loss(), 0);
  const Statistics report = link.session.statistics(link.now);
  EXPECT_EQ(report.packets.lost, 25U);
  EXPECT_EQ(report.received, 102U);
  EXPECT_EQ(report.states, 101U);
  EXPECT_NEAR(report.loss(), 25.0 / 127.0, 1e-9);
}

}  // namespace
}  // namespace r4::test
