// SPDX-License-Identifier: GPL-3.0-or-later
// A few lines on a terminal, redrawn in place.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace r4::tool {

class Screen {
 public:
  Screen() = default;
  ~Screen();
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;

  // False while the terminal is held (Ctrl-S): drawing would wait, and stall the heartbeats.
  static bool has_room();
  // Cut to the terminal's size.
  void draw(std::vector<std::string> lines);
  static std::size_t columns();

 private:
  bool begun_ = false;
  std::size_t drawn_ = 0;  // lines on the screen
};

}  // namespace r4::tool
