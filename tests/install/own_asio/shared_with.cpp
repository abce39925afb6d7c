// SPDX-License-Identifier: GPL-3.0-or-later
// A program with Asio that uses an AsyncBoard on the program's event loop.
#include <asio.hpp>
#include <cstdio>
#include <r4link/async_board.hpp>

int main() {
  asio::io_context io;
  r4::AsyncBoard board(io.get_executor(), "sim:");
  board.open();
  int status = 1;
  board.async_send(r4::Command::identify(), std::chrono::seconds(3),
                   [&](const r4::CommandResult& result) {
                     status = result.outcome == r4::Outcome::confirmed ? 0 : 1;
                     std::printf("own Asio, board %s\n", board.identity().board_id.c_str());
                     board.close();
                   });
  io.run();
  return status;
}
