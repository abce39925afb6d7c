// SPDX-License-Identifier: GPL-3.0-or-later
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

  // False while the terminal is stopped (Ctrl-S): drawing would block and delay the heartbeats.
  static bool has_room();
  void draw(std::vector<std::string> lines);
  static std::size_t columns();

 private:
  bool begun_ = false;
  std::size_t drawn_ = 0;
};

}  // namespace r4::tool
