// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <asio/io_context.hpp>
#include <chrono>

#include "r4link/async_board.hpp"

namespace r4::tool {

// The end of a command that had a board: runs `io`, which was stopped, until the board has said that it is
// free, or does not answer, and closes it. So the next command need not wait for the board's timeout.
inline void say_farewell(asio::io_context& io, AsyncBoard& board) {
  constexpr std::chrono::milliseconds limit{100};
  board.async_close(limit, [&io](const CommandResult&) { io.stop(); });
  io.restart();
  io.run();
}

}  // namespace r4::tool
