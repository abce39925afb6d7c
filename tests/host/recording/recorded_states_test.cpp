// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/recordings/recorded_states.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "tests/support/datagrams.hpp"

namespace r4::test {
namespace {

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
