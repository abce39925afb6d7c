// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "r4link/board.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/datagrams.hpp"

namespace r4::test {
namespace {

struct VisitorOfAll final : RecordingVisitor {
  void on_path(const RecordedPath& path) override {
    paths.push_back(std::to_string(path.number) + " " + path.url + " " + path.name);
  }
  void on_record(const Record& record) override {
    if (record.kind == RecordKind::event) {
      events.push_back(std::to_string(record.path) + " " + std::string(record.bytes));
      return;
    }
    ++(record.kind == RecordKind::from_board ? from : to);
    const State* const state = states.take(record);
    if (state == nullptr) return;
    EXPECT_EQ(record.path, 1);
    EXPECT_GT(record.time, last);
    last = record.time;
    pwm.push_back(state->osmc(1).pwm);
  }
  void on_damage(const RecordingDamage& damage) override { ADD_FAILURE() << damage.reason; }

  RecordedStates states;
  std::vector<std::string> paths, events;
  std::vector<int> pwm;
  Time last{0};
  int from = 0, to = 0;
};

TEST(ReadRecording, VisitsEveryRecord) {
  const std::string path = testing::TempDir() + "r4-read-" + std::to_string(::getpid());
  std::uint64_t received = 0;  // datagrams received after record()
  {
    Board board("sim:", at_will());
    board.record(path);
    const std::uint64_t before = board.statistics().received;
    board.wait_active();
    board.osmc(1).set_pwm(358, Direction::forward);
    board.next_state();
    board.osmc(1).set_pwm(10, Direction::forward);
    received = board.statistics().received - before;
  }
  VisitorOfAll visitor;
  read_recording(path, visitor);
  std::filesystem::remove(path);
  EXPECT_EQ(visitor.paths.back(), "1 sim: sim-1");
  EXPECT_NE(std::find(visitor.pwm.begin(), visitor.pwm.end(), 358), visitor.pwm.end());
  EXPECT_EQ(visitor.pwm.back(), 10);
  EXPECT_GE(visitor.from, static_cast<int>(received));
  EXPECT_GT(visitor.to, 2);
  EXPECT_EQ(visitor.events.back(), "0 end");
}

Record record_of(std::uint16_t path, RecordKind kind, const std::string& bytes) {
  Record record;
  record.path = path;
  record.kind = kind;
  record.bytes = bytes;
  return record;
}

TEST(RecordedStates, AreMergedPerPath) {
  RecordedStates states;
  const std::string volts = with_crc("AIN24:24.28;PNum:7;T:1;");
  const std::string relays = with_crc("RELAYS:3;PNum:8;T:2;");
  const std::string heartbeat = with_crc("H:R4-ROS2;PNum:9;T:3;");
  ASSERT_NE(states.take(record_of(1, RecordKind::from_board, volts)), nullptr);
  const State* const merged = states.take(record_of(1, RecordKind::from_board, relays));
  ASSERT_NE(merged, nullptr);
  EXPECT_EQ(merged->raw.analog_cv[0], 2428);
  EXPECT_EQ(merged->relays, 3);
  EXPECT_FALSE(merged->present.has(StateField::ain24));
  EXPECT_EQ(states.datagram().pnum(), 8U);
  const State* const other = states.take(record_of(2, RecordKind::from_board, relays));
  ASSERT_NE(other, nullptr);
  EXPECT_EQ(other->raw.analog_cv[0], 0) << "the state of another board must not be used";
  EXPECT_EQ(states.take(record_of(1, RecordKind::from_board, heartbeat)), nullptr);
  EXPECT_EQ(states.take(record_of(1, RecordKind::to_board, volts)), nullptr);
  EXPECT_EQ(states.take(record_of(1, RecordKind::from_board, volts + "x")), nullptr);
}

}  // namespace
}  // namespace r4::test
