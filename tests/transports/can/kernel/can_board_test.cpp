// SPDX-License-Identifier: GPL-3.0-or-later
// A board on a CAN bus with its host, channel by channel.
#include <gtest/gtest.h>

#include "r4link/board.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/every_channel.hpp"

namespace r4::test {
namespace {

struct Form {
  const char* name;
  const char* url;
  const char* pack;  // of the host's URL
  bool packed;       // what the host hears
};
class CanBoard : public testing::TestWithParam<Form> {};
INSTANTIATE_TEST_SUITE_P(Forms, CanBoard,
                         testing::Values(Form{"plain", "can://vcan0?node=9", "&pack=0", false},
                                         Form{"packed", "can://vcan0?node=9", "", true},
                                         Form{"fd", "can://vcan0?node=9&fd=1", "&pack=0", false},
                                         Form{"fd_packed", "can://vcan0?node=9&fd=1", "", true}),
                         [](const auto& form) { return std::string(form.param.name); });

TEST_P(CanBoard, EveryChannelReachesItsPinAndComesBack) {
  BoardInAThread simulated(GetParam().url);
  Board board(simulated.url() + GetParam().pack, at_will());
  board.wait_active();
  expect_every_channel(controlled(simulated, board));
  EXPECT_EQ(board.carrier_counters().transfers->packed != 0, GetParam().packed);
}

}  // namespace
}  // namespace r4::test
