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

struct BoardForm {
  const char* name;
  const char* url;
  const char* pack;  // of the host's URL
  bool packed;       // what the host hears
};
class CanBoard : public testing::TestWithParam<BoardForm> {};
INSTANTIATE_TEST_SUITE_P(Forms, CanBoard,
                         testing::Values(BoardForm{"plain", "can://vcan0?node=9", "&pack=0", false},
                                         BoardForm{"packed", "can://vcan0?node=9", "", true},
                                         BoardForm{"fd_packed", "can://vcan0?node=9&fd=1", "",
                                                   true}),
                         [](const auto& form) { return std::string(form.param.name); });

TEST_P(CanBoard, EveryChannelReachesItsPinAndComesBack) {
  BoardInAThread simulated(GetParam().url);
  Board board(simulated.url() + GetParam().pack, at_will());
  board.wait_active();
  // A plain state has 25 frames, which are much for an emulated machine.
  board.setting("rate", GetParam().packed ? "50" : "20");
  expect_every_channel(controlled(simulated, board));
  EXPECT_EQ(board.carrier_counters().transfers->packed != 0, GetParam().packed);
}

// An emulated machine takes longer for a datagram than a real one, and tells so.
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
