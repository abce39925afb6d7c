// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/drivers/ultrasonic.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <vector>

#include "pin_models.hpp"

namespace r4::firmware {
namespace {

// Four sensors with obstacles. The echo rises 450 us after the falling edge of the trigger.
struct UltrasonicBench {
  explicit UltrasonicBench(std::uint8_t fitted = 0x0F)
      : sensors(trigger[0], trigger[1], trigger[2], trigger[3], fitted) {}
  void run(int ms, std::uint32_t step_us = 1000) {
    for (std::uint32_t end = now_us + static_cast<std::uint32_t>(ms) * 1000; now_us != end;
         now_us += step_us) {
      std::array<bool, 4> before{};
      for (std::size_t i = 0; i < 4; ++i) before[i] = trigger[i].high;
      sensors.poll(now_us);
      for (std::size_t i = 0; i < 4; ++i) {
        if (trigger[i].high && !before[i]) turns.emplace_back(static_cast<int>(i), now_us);
        if (trigger[i].high || !before[i]) continue;
        if (echo_us[i] == 0) continue;
        const std::uint32_t rose = now_us + 450;
        sensors.echo(static_cast<int>(i), true, rose);
        pending.emplace_back(static_cast<int>(i), rose + echo_us[i]);
      }
      while (!pending.empty() && static_cast<std::int32_t>(now_us - pending.front().second) >= 0) {
        sensors.echo(pending.front().first, false, pending.front().second);
        pending.erase(pending.begin());
      }
    }
  }
  std::array<test::OutputPinModel, 4> trigger;
  std::array<std::uint32_t, 4> echo_us{};
  std::vector<std::pair<int, std::uint32_t>> turns;
  std::vector<std::pair<int, std::uint32_t>> pending;
  std::uint32_t now_us = 0xFFFE0000U;  // the clock wraps
  UltrasonicSensors sensors;
};

TEST(UltrasonicSensors, TheDistanceIsTheEchoTimeDividedBy58) {
  UltrasonicBench bench;
  bench.echo_us = {58 * 2, 58 * 100 + 57, 58 * 400, 58 * 4};
  bench.run(250);
  EXPECT_EQ(bench.sensors.distance_cm(0), 2);
  EXPECT_EQ(bench.sensors.distance_cm(1), 100);
  EXPECT_EQ(bench.sensors.distance_cm(2), 400);
  EXPECT_EQ(bench.sensors.distance_cm(3), 4);
}

TEST(UltrasonicSensors, TakesTurnsSixtyMillisecondsApart) {
  UltrasonicBench bench;
  bench.echo_us = {1000, 1000, 1000, 1000};
  bench.run(1000);
  ASSERT_GE(bench.turns.size(), 16U);
  for (std::size_t i = 1; i < bench.turns.size(); ++i) {
    EXPECT_EQ(bench.turns[i].first, (bench.turns[i - 1].first + 1) % 4);
    EXPECT_GE(bench.turns[i].second - bench.turns[i - 1].second, 60000U);
    EXPECT_LE(bench.turns[i].second - bench.turns[i - 1].second, 61000U);
  }
}

// The limit of docs/reference/safety.md, "How long it takes", without the turn of the application.
TEST(UltrasonicSensors, SeesAnObstacleOrASilentSensorWithinFourTurnsAndItsEcho) {
  struct Case {
    std::uint32_t echo_us;
    EchoResult result;
    int most_ms;
  };
  for (const Case& c : {Case{58 * 20, EchoResult::distance, 4 * 60 + 3},
                        Case{58 * 400, EchoResult::distance, 4 * 60 + 25},
                        Case{0, EchoResult::no_answer, 4 * 60 + 41}}) {
    int longest_ms = 0;
    for (int begins_ms = 0; begins_ms < 240; ++begins_ms) {
      UltrasonicBench bench;
      bench.echo_us = {38000, 38000, 38000, 38000};
      bench.run(300 + begins_ms);
      ASSERT_EQ(bench.sensors.result(1), EchoResult::no_echo);
      bench.echo_us[1] = c.echo_us;
      int ms = 0;
      for (; bench.sensors.result(1) != c.result && ms < 1000; ++ms) bench.run(1);
      longest_ms = std::max(longest_ms, ms);
    }
    EXPECT_LE(longest_ms, c.most_ms) << c.echo_us;
  }
}

TEST(UltrasonicSensors, TheTriggerLastsTenMicrosecondsOrMore) {
  UltrasonicBench bench(0x01);
  bench.run(1, 2);
  EXPECT_EQ(bench.trigger[0].rises, 1);
  bench.now_us = 0;
  test::OutputPinModel pins[4];
  UltrasonicSensors sensors(pins[0], pins[1], pins[2], pins[3], 1);
  sensors.poll(100);
  EXPECT_TRUE(pins[0].high);
  sensors.poll(109);
  EXPECT_TRUE(pins[0].high);
  sensors.poll(110);
  EXPECT_FALSE(pins[0].high);
}

TEST(UltrasonicSensors, DistinguishesNoEchoASilentSensorAndAStuckLine) {
  UltrasonicBench bench;
  bench.echo_us = {58 * 401, 39000, 0, 580};
  bench.run(200);
  bench.sensors.echo(3, true, bench.now_us);
  bench.run(300);
  EXPECT_EQ(bench.sensors.result(0), EchoResult::no_echo);
  EXPECT_EQ(bench.sensors.result(1), EchoResult::no_echo);
  EXPECT_EQ(bench.sensors.result(2), EchoResult::no_answer);
  EXPECT_EQ(bench.sensors.result(3), EchoResult::line_stuck);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(bench.sensors.distance_cm(i), 0);
}

TEST(UltrasonicSensors, AnObstacleAtTheSensorReadsOneCentimetre) {
  UltrasonicBench bench(0x01);
  bench.echo_us = {20, 0, 0, 0};
  bench.run(70);
  EXPECT_EQ(bench.sensors.distance_cm(0), 1);
}

TEST(UltrasonicSensors, TriggersOnlyFittedSensors) {
  UltrasonicBench bench(0b1010);
  bench.run(500);
  EXPECT_EQ(bench.trigger[0].rises, 0);
  EXPECT_GT(bench.trigger[1].rises, 2);
  EXPECT_EQ(bench.trigger[2].rises, 0);
  EXPECT_GT(bench.trigger[3].rises, 2);
  UltrasonicBench none(0);
  none.run(500);
  EXPECT_TRUE(none.turns.empty());
}

TEST(UltrasonicSensors, IgnoresALateEchoOfAnotherSensor) {
  UltrasonicBench bench(0b0011);
  bench.echo_us = {0, 0, 0, 0};
  bench.run(65);
  bench.sensors.echo(0, true, bench.now_us);
  bench.sensors.echo(0, false, bench.now_us + 600);
  bench.run(60);
  EXPECT_EQ(bench.sensors.result(1), EchoResult::no_answer);
}

}  // namespace
}  // namespace r4::firmware
