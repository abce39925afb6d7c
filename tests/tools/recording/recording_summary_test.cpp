// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/r4/recording/recording_summary.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <string>

#include "r4link/messages/datagram_writer.hpp"
#include "r4link/recordings/record_line.hpp"
#include "tests/support/datagrams.hpp"
#include "tests/support/problems.hpp"

namespace r4::tool {
namespace {

using namespace std::chrono_literals;

struct RecordingSummaryTest : testing::Test {
  RecordingSummaryTest() {
    summary.on_header();
    summary.on_path({1, "udp://robot", "left"});
  }
  void add(RecordKind kind, const std::string& bytes, std::uint16_t path = 1) {
    summary.on_record({now, path, kind, bytes});
  }
  // A datagram from the board, 10 ms after the previous datagram.
  void hear(const std::string& fields) {
    now += 10ms;
    add(RecordKind::from_board,
        test::with_crc(fields + ";PNum:" + std::to_string(++pnum) + ";T:5;"));
  }
  Json path() const { return summary.json("x")["paths"][0]; }

  RecordingSummary summary;
  Time now{std::chrono::hours{24 * 365 * 50}};
  std::uint32_t pnum = 100;
};

TEST_F(RecordingSummaryTest, ShowsTheStateRateAndLostAndDamagedDatagrams) {
  for (int i = 0; i < 101; ++i) hear("AIN24:24.28");
  pnum += 3;
  hear("AIN24:24.28");
  add(RecordKind::from_board, "AIN24:24.28;PNum:1;T:5;^0x1^");
  EXPECT_EQ(path()["states"], 102);
  EXPECT_NEAR(path()["states_hz"].get<double>(), 100, 0.01);
  EXPECT_EQ(path()["lost"], 3);
  EXPECT_EQ(path()["damaged"], 1);
}

TEST_F(RecordingSummaryTest, ShowsTheSafeStatesAndTheirDurations) {
  hear("AIN24:24.28");
  for (int i = 0; i < 51; ++i) hear("AIN24:24.28;SAFE:2");
  hear("AIN24:24.28");
  hear("AIN24:24.28;SAFE:1");
  hear("AIN24:24.28;SAFE:0");
  EXPECT_EQ(path()["safe"]["stop"], 1);
  EXPECT_EQ(path()["safe"]["link"], 1);
  EXPECT_NEAR(path()["safe_s"].get<double>(), 0.52, 0.001);
  EXPECT_TRUE(test::contains(summary.text("x"), "safe for 0.5 s, link (1 times), stop (1 times)"));
}

TEST_F(RecordingSummaryTest, HasTheGaps) {
  hear("AIN24:24.28");
  now += 1s;
  hear("AIN24:24.28");
  now += 3s;
  hear("AIN24:24.28");
  EXPECT_EQ(path()["gaps"], 2);
  EXPECT_NEAR(path()["longest_gap_s"].get<double>(), 3.01, 0.001);
}

TEST_F(RecordingSummaryTest, CountsDatagramsSentToTheBoard) {
  add(RecordKind::to_board, test::with_crc("H:ROS2-R4;PNum:1;T:5;"));
  add(RecordKind::to_board, test::with_crc("E:STOP;PNum:2;T:5;"));
  EXPECT_EQ(path()["sent"], 2);
  EXPECT_EQ(path()["heartbeats"], 1);
  EXPECT_EQ(path()["stops"], 1);
}

TEST_F(RecordingSummaryTest, DoesNotCountARebootAsALoss) {
  hear("AIN24:24.28");
  add(RecordKind::from_board, test::with_crc("H:R4-ROS2;PNum:0;T:0;"));
  pnum = 5000;
  hear("AIN24:24.28");
  EXPECT_EQ(path()["lost"], 0);
}

TEST_F(RecordingSummaryTest, ShowsTheEndAndTheDroppedRecords) {
  EXPECT_FALSE(summary.json("x")["ended"]);
  add(RecordKind::event, "dropped 17", 0);
  add(RecordKind::event, "end", 0);
  EXPECT_TRUE(summary.json("x")["ended"]);
  EXPECT_EQ(summary.json("x")["dropped"], 17);
  add(RecordKind::event, "down udp://robot: gone", 1);
  EXPECT_EQ(path()["downs"], 1);
}

TEST_F(RecordingSummaryTest, ListsTwentyDamagedLinesAndCountsTheRest) {
  for (std::uint64_t i = 1; i <= 1000; ++i) {
    summary.on_damage(
        {RecordingDamage::Kind::line, i, 10 * i, "the line does not begin with a time"});
  }
  EXPECT_TRUE(summary.damaged());
  EXPECT_EQ(summary.json("x")["damage"].size(), 20);
  EXPECT_EQ(summary.json("x")["damage_count"], 1000);
  EXPECT_TRUE(
      test::contains(summary.text("x"), "line 20, byte 200: the line does not begin with a time"));
  EXPECT_TRUE(test::contains(summary.text("x"), "and 980 more"));
}

}  // namespace
}  // namespace r4::tool
