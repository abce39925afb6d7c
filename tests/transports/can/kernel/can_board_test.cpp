// SPDX-License-Identifier: GPL-3.0-or-later
// A board on a CAN bus with its host, channel by channel.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <chrono>

#include "r4link/board.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/every_channel.hpp"
#include "tests/support/sampled_truth.hpp"

namespace r4::test {
namespace {

// In the packed form. In plain text every channel goes over UDP and a pty
// (tests/host/board_test.cpp).
TEST(CanBoard, EveryChannelReachesItsPinAndComesBack) {
  BoardInAThread simulated("can://vcan0?node=9");
  Board board(simulated.url(), at_will());
  board.wait_active();
  board.setting("rate", "50");  // an emulated machine has not the time for 100
  expect_every_channel(controlled(simulated, board));
  EXPECT_NE(board.carrier_counters().transfers->packed, 0U);
}

// An emulated computer takes longer for a datagram than a real one, and reports so.
TEST(CanSampledTime, IsWithinItsErrorAlways) {
  using namespace std::chrono_literals;
  BoardInAThread simulated("can://vcan0?node=9");
  const SampledTruth found = look_at_sampled(simulated, simulated.url(), 1500us);
  fmt::print(
      "{} states, {} farther from the truth than told; told {} us, were {} us (median), {} us "
      "(worst)\n",
      found.states, found.dishonest, found.bound / 1us, found.median_error / 1us,
      found.worst_error / 1us);
  EXPECT_EQ(found.dishonest, 0U);
  EXPECT_LE(found.median_error, 1ms);
}

}  // namespace
}  // namespace r4::test
