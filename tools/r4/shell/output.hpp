// SPDX-License-Identifier: GPL-3.0-or-later
// Standard output for commands that keep a link alive: whoever reads it may stall, the command may
// not. See also line_writer.hpp, which has a thread for that.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>
#include <string_view>
#include <vector>

namespace r4::tool {

// Room for a line on stdout, so that a reader who has stalled cannot stall our heartbeats.
bool output_has_room();

// Prints only while the output has room.
class OutputLines {
 public:
  // Waits for room, the newest 64 of such lines.
  void print(std::string line);
  // Is left out if there is no room.
  void print_or_skip(std::string_view line);
  // Prints what waits, as far as there is room.
  void print_held();
  // Lines that were left out.
  std::uint64_t skipped() const { return skipped_ + held_.size(); }

 private:
  std::deque<std::string> held_;
  std::uint64_t skipped_ = 0;
};

// A few lines on a terminal, redrawn in place.
class Screen {
 public:
  Screen() = default;
  ~Screen();
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;

  // Cut to the terminal's size.
  void draw(std::vector<std::string> lines);
  static std::size_t columns();

 private:
  bool begun_ = false;
  std::size_t drawn_ = 0;  // lines on the screen
};

}  // namespace r4::tool
