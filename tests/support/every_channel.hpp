// SPDX-License-Identifier: GPL-3.0-or-later
// Tests every channel of a board from end to end, over any transport: from a command at the host,
// over the register and the pin in the model, to the state at the host; and every input from its
// pin to the host.
#pragma once

#include <functional>
#include <string>

#include "board_in_a_thread.hpp"
#include "firmware/ports/sim/simulated_board.hpp"
#include "r4link/board.hpp"
#include "r4link/state.hpp"

namespace r4::test {

// A host that controls a simulated board, and a way to the board itself.
struct ControlledBoard {
  std::function<void(const std::string&)> command;  // returns when it was executed
  std::function<State()> next_state;                // one that was sent after the call
  std::function<void(const std::function<void(sim::SimulatedBoard&)>&)> at_board;
};

// For a board in a thread, and the host that has opened it.
ControlledBoard controlled(BoardInAThread& simulated, Board& host);

void expect_every_channel(const ControlledBoard& board);

}  // namespace r4::test
