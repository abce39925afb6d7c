// SPDX-License-Identifier: GPL-3.0-or-later
// A program with Asio that uses the blocking Board, which has a separate Asio inside.
#include <asio.hpp>
#include <cstdio>
#include <r4link/r4link.hpp>

int main() {
  r4::Board board("sim:");
  board.wait_active();
  asio::io_context io;
  asio::steady_timer timer(io, std::chrono::milliseconds(20));
  timer.async_wait([&](const asio::error_code& error) {
    if (!error) std::printf("own Asio, board %s\n", board.identify().board_id.c_str());
  });
  io.run();
  try {
    board.osmc(1).set_pwm(1, r4::Direction::forward);
  } catch (const r4::Error& error) {
    return error.outcome() == r4::Outcome::not_armed ? 0 : 1;
  }
  return 1;
}
