// SPDX-License-Identifier: GPL-3.0-or-later
// What both forms of the board, blocking (board.hpp) and asynchronous (async_board.hpp), share.
#pragma once

#include <chrono>
#include <string>

#include "session/session.hpp"

namespace r4 {

struct BoardOptions {
  SessionOptions session;
  // Of Board only: after so long in one callback the heartbeats stop, and the board goes safe, for
  // nobody looks after the robot; up to an hour, 0 turns it off. They go on when it returns.
  std::chrono::milliseconds callback_limit{500};
};

// Who a board is, owned.
struct BoardIdentity {
  std::string firmware;
  std::string board_id;
  std::string capabilities;
};

}  // namespace r4
