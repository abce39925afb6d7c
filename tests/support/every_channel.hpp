// SPDX-License-Identifier: GPL-3.0-or-later
// Tests every channel of a board from end to end, over any transport. An output is tested from a
// command of the host over the register and the pin of the model to the state at the host. An input
// is tested from its pin to the host.
#pragma once

#include <functional>
#include <string>

#include "board_in_a_thread.hpp"
#include "firmware/ports/sim/simulated_board.hpp"
#include "r4link/board.hpp"
#include "r4link/state.hpp"

namespace r4::test {

// A host that controls a simulated board, and direct access to the board.
struct ControlledBoard {
  std::function<void(const std::string&)> command;  // returns after the execution
  std::function<State()> next_state;                // a state that was sent after the call
  std::function<void(const std::function<void(sim::SimulatedBoard&)>&)> at_board;
};

// For a board in a thread and the host that controls the board.
ControlledBoard controlled(BoardInAThread& simulated, Board& host);

void expect_every_channel(const ControlledBoard& board);

}  // namespace r4::test
