// SPDX-License-Identifier: GPL-3.0-or-later
// What both forms of the board, blocking (board.hpp) and asynchronous (async_board.hpp), share.
#pragma once

#include <string>

#include "session/session.hpp"

namespace r4 {

struct BoardOptions {
  SessionOptions session;
};

// Who a board is, owned.
struct BoardIdentity {
  std::string firmware;
  std::string board_id;
  std::string capabilities;
};

}  // namespace r4
