// SPDX-License-Identifier: GPL-3.0-or-later
// The reference of python_bench.py. `r4_confirmed_send URL COUNT` sends each command after the
// confirmation of the previous command, and prints the median time of a command in microseconds.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "r4link/board.hpp"

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  using Clock = std::chrono::steady_clock;
  try {
    r4::Board board(argv[1]);
    board.wait_active();
    std::vector<double> us(std::max<std::size_t>(1, std::strtoul(argv[2], nullptr, 10)));
    for (std::size_t i = 0; i < us.size(); ++i) {
      const auto start = Clock::now();
      board.send(r4::Command::proximity(1, r4::Centimetres(static_cast<int>(i % 2))));
      us[i] = std::chrono::duration<double, std::micro>(Clock::now() - start).count();
    }
    std::sort(us.begin(), us.end());
    std::printf("%.1f\n", us[us.size() / 2]);
  } catch (const r4::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
