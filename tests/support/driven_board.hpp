// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <gtest/gtest.h>

#include "r4link/board.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/board_in_a_thread.hpp"

namespace r4::test {

struct DrivenBoard : testing::Test {
  DrivenBoard() { board.wait_active(); }
  BoardInAThread simulated{"udp"};
  Board board{simulated.url(), at_will()};
};

}  // namespace r4::test
