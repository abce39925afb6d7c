// SPDX-License-Identifier: GPL-3.0-or-later
// The number of boards that one bus can carry, on a bus that is exact to the bit.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "tests/support/can_backbone.hpp"

namespace r4::test {
namespace {

constexpr std::uint32_t link_timeout_us = 1000000;

void print(const char* what, const BackboneResult& result) {
  std::printf(
      "%-40s load %5.1f %%, %.0f frames/s; states and board heartbeats: %u, %u lost, %u replaced, "
      "latest after %.2f ms; to boards: %u, %u lost, latest after %.2f ms\n",
      what, 100 * result.load, result.frames_per_second, result.telemetry.sent,
      result.telemetry.lost(), result.telemetry.replaced, result.telemetry.max_late_us / 1e3,
      result.commands.sent, result.commands.lost(), result.commands.max_late_us / 1e3);
}

// `replaced`: states per thousand that newer states may replace.
void expect_all_there(const BackboneResult& result, std::uint32_t replaced = 0) {
  EXPECT_LE(result.load, 0.90);
  EXPECT_EQ(result.telemetry.lost(), 0U);
  EXPECT_LE(result.telemetry.replaced * 1000, replaced * result.telemetry.sent);
  EXPECT_EQ(result.commands.lost(), 0U);
  EXPECT_EQ(result.isotp_errors, 0U);
  EXPECT_LT(result.max_silence_us, link_timeout_us) << "a false trip";
}

FieldSet confirmed_fields() {  // the fields that our host selects
  FieldSet fields = FieldSet::paper_default();
  fields.add(StateField::safe);
  fields.add(StateField::cmd);
  return fields;
}

TEST(CanCapacity, EightBoardsInPackedFormFitOneClassicBus) {
  BackboneOptions options;
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    options.bus.seed = seed;
    const BackboneResult result = run_backbone(options);
    print("8 boards, packed", result);
    expect_all_there(result);
  }
}

// Ten times a second, everything is sent at once, which is more than the bus carries in one state
// period. Boards that lose the arbitration then skip a state.
constexpr std::uint32_t replaced_in_step = 12;

TEST(CanCapacity, EightBoardsFitWhenAllSendAtTheSameInstant) {
  BackboneOptions options;
  options.in_step = true;
  const BackboneResult result = run_backbone(options);
  print("8 boards, packed, in step", result);
  expect_all_there(result, replaced_in_step);
}

TEST(CanCapacity, EightBoardsFitWithTheFieldsThatConfirmCommands) {
  BackboneOptions options;
  options.fields = confirmed_fields();
  for (const bool in_step : {false, true}) {
    options.in_step = in_step;
    const BackboneResult result = run_backbone(options);
    print(in_step ? "8 boards, packed, SAFE and CMD, in step" : "8 boards, packed, SAFE and CMD",
          result);
    expect_all_there(result, in_step ? replaced_in_step : 0);
  }
}

TEST(CanCapacity, TwoBoardsFitInPlainFormAndFourDoNot) {
  BackboneOptions options;
  options.packed = false;
  options.boards = 2;
  for (const bool in_step : {false, true}) {
    options.in_step = in_step;
    const BackboneResult result = run_backbone(options);
    print(in_step ? "2 boards, plain, in step" : "2 boards, plain", result);
    expect_all_there(result);
  }
  options.in_step = false;
  options.boards = 4;
  const BackboneResult overloaded = run_backbone(options);
  print("4 boards, plain", overloaded);
  EXPECT_GT(overloaded.load, 0.99);
  EXPECT_GT(overloaded.telemetry.replaced, 0U);
}

TEST(CanCapacity, EightBoardsInPlainFormFitAnFdBus) {
  BackboneOptions options;
  options.packed = false;
  options.tx_dl = 64;
  options.bus.rate = {1000000, 5000000};
  const BackboneResult result = run_backbone(options);
  print("8 boards, plain, FD 1M/5M", result);
  expect_all_there(result);
}

// The fields that our host selects need a frame of 48 bytes, and so more than 5 Mbit/s.
TEST(CanCapacity, EightBoardsAtAKilohertzFitAnFdBusInPackedForm) {
  BackboneOptions options;
  options.tx_dl = 64;
  options.states_hz = 1000;
  options.seconds = 1;
  for (const bool confirmed : {false, true}) {
    if (confirmed) options.fields = confirmed_fields();
    options.bus.rate = {1000000, confirmed ? 8000000U : 5000000U};
    for (const std::uint64_t seed : {1U, 2U}) {
      options.bus.seed = seed;
      const BackboneResult result = run_backbone(options);
      print(confirmed ? "8 boards at 1 kHz, SAFE, CMD, FD 1M/8M" : "8 boards at 1 kHz, FD 1M/5M",
            result);
      EXPECT_GE(result.telemetry.sent, 8000U);
      expect_all_there(result);
    }
  }
}

// The controllers repeat damaged frames, which costs time but no datagram.
TEST(CanCapacity, OneDamagedFrameInAHundredLosesNothing) {
  BackboneOptions options;
  options.bus.corrupted = 0.01;
  const BackboneResult result = run_backbone(options);
  print("8 boards, packed, 1 % of frames damaged", result);
  expect_all_there(result);
}

// Frames that a listener misses are lost. A datagram of n frames arrives with probability 0.99^n.
TEST(CanCapacity, OneMissedFrameInAHundredLosesOnlyItsDatagrams) {
  BackboneOptions options;
  options.bus.missed = 0.01;
  options.commands_hz = options.host_heartbeats_hz = options.board_heartbeats_hz = 0;
  options.seconds = 60;
  const BackboneResult result = run_backbone(options);
  print("8 boards, packed, 1 % of frames missed", result);
  const double delivered = 1.0 * result.telemetry.delivered / result.telemetry.sent;
  const double states_per_second = 1.0 * result.telemetry.sent / options.seconds;
  EXPECT_NEAR(delivered, std::pow(0.99, result.frames_per_second / states_per_second), 0.01);
}

TEST(CanCapacity, TheSameSeedGivesTheSameRun) {
  BackboneOptions options;
  options.seconds = 2;
  options.bus.corrupted = 0.01;
  options.bus.missed = 0.01;
  const BackboneResult one = run_backbone(options);
  const BackboneResult two = run_backbone(options);
  EXPECT_EQ(one.load, two.load);
  EXPECT_EQ(one.telemetry.delivered, two.telemetry.delivered);
  EXPECT_EQ(one.commands.max_late_us, two.commands.max_late_us);
}

}  // namespace
}  // namespace r4::test
