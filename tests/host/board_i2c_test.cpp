// SPDX-License-Identifier: GPL-3.0-or-later
// Devices on the user's I2C bus, through r4::Board.
#include <gtest/gtest.h>

#include "r4link/board.hpp"
#include "r4link/error.hpp"
#include "tests/support/driven_board.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;
using Bytes = Board::I2c::Bytes;

struct BoardI2c : DrivenBoard {};

TEST_F(BoardI2c, ReadsWritesAndScans) {
  EXPECT_EQ(board.i2c().scan(), (Bytes{0x40, 0x68}));
  EXPECT_EQ(board.i2c().read(0x68, {0x75}, 1), Bytes{0x68});
  EXPECT_EQ(board.i2c().write(0x68, {0x6B, 0x00}), Bytes{});
  EXPECT_EQ(board.i2c().read(0x68, {0x6B}, 1), Bytes{0x00});
  EXPECT_EQ(board.i2c().write(0x40, {0x00}, 2), (Bytes{0x39, 0x9F}));
  const auto read = [&](int address) {
    return problem_of([&] { board.i2c().read(address, {0x00}, 1); });
  };
  EXPECT_EQ(read(0x50).reason, "no acknowledge");
  EXPECT_EQ(read(7).kind, ErrorKind::usage);
  EXPECT_EQ(read(0x168).kind, ErrorKind::usage);
}

TEST_F(BoardI2c, RefusesACommandThatIsNotATransfer) {
  const Problem problem = problem_of([&] { board.i2c().transfer(Command::relay(2, false)); });
  EXPECT_EQ(problem.kind, ErrorKind::usage);
  EXPECT_EQ(problem.reason, "is not a valid transfer on the I2C bus");
}

TEST_F(BoardI2c, PutsRepeatedReadingsIntoTheState) {
  board.i2c().poll(1, 0x68, {0x75}, 1, 10ms);
  board.fields("I2C1");
  ReceivedState state = board.next_state();
  for (int i = 0; i < 100 && state.raw.i2c[0].data.size == 0; ++i) state = board.next_state();
  ASSERT_EQ(state.raw.i2c[0].data.size, 1);
  EXPECT_EQ(state.raw.i2c[0].data.bytes[0], 0x68);
  // If the loop of a board is late, the board samples after the T of its state.
  EXPECT_LE(static_cast<std::int32_t>(state.t_ms - state.raw.i2c[0].t_ms), 40);
  board.i2c().poll_off(1);
  for (int i = 0; i < 100 && state.raw.i2c[0].data.size != 0; ++i) state = board.next_state();
  EXPECT_EQ(state.raw.i2c[0].data.size, 0);
  EXPECT_THROW(board.i2c().poll(9, 0x68, {0x75}, 1, 10ms), Error);
  EXPECT_THROW(board.i2c().poll(1, 0x68, {0x75}, 1, 4ms), Error);
}

}  // namespace
}  // namespace r4::test
