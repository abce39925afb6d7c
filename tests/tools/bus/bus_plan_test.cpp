// SPDX-License-Identifier: GPL-3.0-or-later
// The results of `r4 bus`, compared with the bus model. Command and model share only the function
// that counts the bits of a frame.
#include "tools/r4/bus/bus_plan.hpp"

#include <gtest/gtest.h>

#include <cstdio>

#include "r4link/datagram.hpp"
#include "tests/support/can_backbone.hpp"

namespace r4::tool {
namespace {

FieldSet confirmed_fields() {
  FieldSet fields = FieldSet::paper_default();
  fields.add(StateField::safe);
  fields.add(StateField::cmd);
  return fields;
}

// Prints both loads, and fails unless they are within 2 % of each other.
void expect_agreement(const char* what, const BusPlan& plan) {
  test::BackboneOptions options;
  options.boards = static_cast<int>(plan.boards);
  options.bus.rate = plan.bit_rate;
  options.packed = plan.packed;
  options.fields = plan.fields;
  options.states_hz = plan.states_hz;
  options.commands_hz = plan.commands_hz;
  options.tx_dl = plan.bit_rate.data != 0 ? max_fd_size : max_classic_size;
  const test::BackboneResult model = test::run_backbone(options);
  const BusTraffic planned = load_of(plan).total;
  std::printf("%-32s planned %.2f %%, model %.2f %%, worst %.2f %%\n", what, 100 * planned.load,
              100 * model.load, 100 * planned.worst_load);
  EXPECT_NEAR(planned.load, model.load, 0.02 * model.load) << what;
  EXPECT_NEAR(planned.frames, model.frames_per_second, 0.02 * model.frames_per_second) << what;
  EXPECT_GE(planned.worst_load, model.load) << what;
}

BusPlan plan_for(std::uint32_t boards, bool packed) {
  BusPlan plan;
  plan.boards = boards;
  plan.packed = packed;
  plan.fields = FieldSet::paper_default();
  return plan;
}

TEST(BusPlan, AgreesWithTheBusModel) {
  expect_agreement("8 boards, packed", plan_for(8, true));
  expect_agreement("2 boards, plain", plan_for(2, false));

  BusPlan plan = plan_for(8, true);
  plan.fields = confirmed_fields();
  expect_agreement("8 boards, packed, SAFE and CMD", plan);

  plan = plan_for(3, true);
  plan.fields = FieldSet::all();
  plan.states_hz = 50;
  plan.commands_hz = 5;
  expect_agreement("3 boards, packed, ALL at 50 Hz", plan);

  plan = plan_for(8, false);
  plan.bit_rate = {1000000, 5000000};
  expect_agreement("8 boards, plain, FD", plan);

  plan = plan_for(4, true);
  plan.bit_rate = {500000, 0};
  expect_agreement("4 boards, packed, 500 kbit/s", plan);
}

TEST(BusPlan, FindsTheLargestRateAndNumberOfBoardsThatFit) {
  BusPlan plan = plan_for(8, true);
  const std::uint32_t boards = most_boards(plan, 0.8);
  const std::uint32_t rate = highest_rate(plan, 0.8);
  plan.states_hz = rate;
  EXPECT_LE(load_of(plan).total.load, 0.8);
  plan.states_hz = rate + 1;
  EXPECT_GT(load_of(plan).total.load, 0.8);
  plan.states_hz = 100;
  plan.boards = boards;
  EXPECT_LE(load_of(plan).total.load, 0.8);
  plan.boards = boards + 1;
  EXPECT_GT(load_of(plan).total.load, 0.8);
}

TEST(BusPlan, ABusThatCannotCarryTheHeartbeatsHasRoomForNoBoard) {
  BusPlan plan = plan_for(32, false);
  plan.bit_rate.nominal = 10000;
  EXPECT_EQ(most_boards(plan, 0.8), 0U);
  EXPECT_EQ(highest_rate(plan, 0.8), 0U);
}

// The state is longer than a datagram can be, so the board sends the state in parts.
TEST(BusPlan, SplitsAllFieldsLikeTheBoard) {
  BusPlan plan = plan_for(1, false);
  plan.fields = FieldSet::all();
  const BusTraffic states = load_of(plan).traffic.front();
  EXPECT_GE(states.datagrams, 100);
  EXPECT_LE(states.bytes, max_datagram);
  EXPECT_GT(load_of(plan).total.worst_load, states.load);
}

}  // namespace
}  // namespace r4::tool
