// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/can/can_ids.hpp"

#include <gtest/gtest.h>

#include <map>
#include <utility>

namespace r4 {
namespace {

static_assert(emergency_stop_id == 0x010, "known when compiling");
static_assert(classify(telemetry_id(5)).node == 5, "known when compiling");

TEST(CanIds, HaveTheDocumentedValues) {
  EXPECT_EQ(went_safe_id(0), 0x020U);
  EXPECT_EQ(went_safe_id(31), 0x03FU);
  EXPECT_EQ(command_id(0), 0x180U);
  EXPECT_EQ(command_id(31), 0x19FU);
  EXPECT_EQ(reply_id(0), 0x200U);
  EXPECT_EQ(reply_id(31), 0x21FU);
  EXPECT_EQ(telemetry_id(0), 0x400U);
  EXPECT_EQ(telemetry_id(31), 0x41FU);
  EXPECT_EQ(watch_id(0), 0x600U);
  EXPECT_EQ(watch_id(31), 0x61FU);
}

TEST(CanIds, UrgentFramesWinTheBus) {
  EXPECT_LT(emergency_stop_id, went_safe_id(0));
  EXPECT_LT(went_safe_id(31), command_id(0));
  EXPECT_LT(command_id(31), reply_id(0));
  EXPECT_LT(reply_id(31), telemetry_id(0));
  EXPECT_LT(telemetry_id(31), watch_id(0));
}

TEST(CanIds, EveryIdHasExactlyOneMeaning) {
  std::map<std::uint32_t, std::pair<CanIdKind, int>> plan{
      {emergency_stop_id, {CanIdKind::emergency_stop, 0}}};
  for (std::uint32_t node = 0; node < can_nodes; ++node) {
    const int n = static_cast<int>(node);
    plan[went_safe_id(node)] = {CanIdKind::went_safe, n};
    plan[command_id(node)] = {CanIdKind::command, n};
    plan[reply_id(node)] = {CanIdKind::reply, n};
    plan[telemetry_id(node)] = {CanIdKind::telemetry, n};
    plan[watch_id(node)] = {CanIdKind::watch, n};
  }
  EXPECT_EQ(plan.size(), 1 + 5 * can_nodes) << "every id has one meaning";
  for (std::uint32_t id = 0; id <= max_can_id; ++id) {
    const auto found = plan.find(id);
    const auto expected =
        found == plan.end() ? std::pair<CanIdKind, int>{CanIdKind::other, 0} : found->second;
    EXPECT_EQ(classify(id).kind, expected.first) << id;
    EXPECT_EQ(classify(id).node, expected.second) << id;
  }
}

TEST(CanIds, IgnoreFramesOfAnotherFormat) {
  CanFrame frame{};
  frame.id = emergency_stop_id;
  EXPECT_EQ(classify(frame).kind, CanIdKind::emergency_stop);
  frame.extended = true;
  EXPECT_EQ(classify(frame).kind, CanIdKind::other);
  frame.extended = false;
  frame.remote = true;
  EXPECT_EQ(classify(frame).kind, CanIdKind::other);
  EXPECT_EQ(classify(0x800 + emergency_stop_id).kind, CanIdKind::other);
}

TEST(CanFrame, AcceptsOnlyValidFrameSizes) {
  const int sizes[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
  int at = 0;
  for (int size = 0; size <= 64; ++size) {
    if (size > sizes[at]) ++at;
    EXPECT_EQ(can_frame_size(static_cast<std::uint32_t>(size)), sizes[at]) << size;
    CanFrame frame{};
    frame.size = static_cast<std::uint8_t>(size);
    EXPECT_EQ(has_valid_size(frame), size <= 8) << size;
    frame.fd = true;
    EXPECT_EQ(has_valid_size(frame), size == sizes[at]) << size;
  }
  EXPECT_EQ(can_frame_size(65), 64);
}

}  // namespace
}  // namespace r4
