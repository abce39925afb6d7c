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
  bool packed;
};
class CanBoard : public testing::TestWithParam<Form> {};
INSTANTIATE_TEST_SUITE_P(Forms, CanBoard,
                         testing::Values(Form{"plain", "can://vcan0?node=9", false},
                                         Form{"packed", "can://vcan0?node=9", true},
                                         Form{"fd", "can://vcan0?node=9&fd=1", false}),
                         [](const auto& form) { return std::string(form.param.name); });

TEST_P(CanBoard, EveryChannelReachesItsPinAndComesBack) {
  BoardInAThread simulated(GetParam().url);
  Board board(simulated.url() + (GetParam().packed ? "&pack=1" : ""), at_will());
  board.wait_active();
  if (GetParam().packed) board.setting("pack", "1");
  expect_every_channel(controlled(simulated, board));
}

}  // namespace
}  // namespace r4::test
