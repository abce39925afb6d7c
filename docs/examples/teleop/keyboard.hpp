// SPDX-License-Identifier: GPL-3.0-or-later
// Single key presses, without the Enter key.
#pragma once

#include <termios.h>

#include <chrono>
#include <optional>

class Keyboard {
 public:
  // Switches a terminal on standard input to single keys. A pipe or a file needs no switch.
  Keyboard();
  // Restores the terminal.
  ~Keyboard();
  Keyboard(const Keyboard&) = delete;
  Keyboard& operator=(const Keyboard&) = delete;

  // The newest key within `at_most`. Empty if there is no key, or if the input has ended
  // (at_end()).
  std::optional<char> key(std::chrono::milliseconds at_most);
  bool at_end() const { return at_end_; }

 private:
  std::optional<termios> before_;
  bool at_end_ = false;
};
