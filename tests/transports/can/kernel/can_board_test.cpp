// SPDX-License-Identifier: GPL-3.0-or-later
// Tests every channel of a board on a CAN bus with its host.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <chrono>

#include "r4link/board.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/every_channel.hpp"
#include "tests/support/sampled_truth.hpp"

namespace r4::test {
namespace {

// The datagrams are packed. tests/host/board_test.cpp tests every channel in plain text over UDP
// and a pty.
TEST(CanBoard, EveryChannelReachesItsPinAndComesBack) {
  BoardInAThread simulated("can://vcan0?node=9");
  Board board(simulated.url(), at_will());
  board.wait_active();
  board.setting("rate", "50");  // an emulated machine is too slow for 100
  expect_every_channel(controlled(simulated, board));
  EXPECT_NE(board.carrier_counters().transfers->packed, 0U);
}

// An emulated machine takes longer for a datagram than a real machine. The reported error includes
// this time.
TEST(CanSampledTime, IsAlwaysWithinItsErrorBound) {
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
