// SPDX-License-Identifier: GPL-3.0-or-later
#include <r4link/r4link.hpp>

int main() {
  r4::Board board("sim:");
  board.wait_active();
  return 0;
}
