// SPDX-License-Identifier: GPL-3.0-or-later
// Standard input byte by byte. The destructor restores the terminal's settings. SIGINT, SIGTERM and
// SIGHUP end the input, so that moving outputs are stopped in order. Ctrl-Z has no effect.
#pragma once

#include <termios.h>

#include <chrono>
#include <csignal>
#include <optional>

namespace r4::tool {

class Keyboard {
 public:
  static constexpr int nothing = -1;  // no byte arrived in time
  static constexpr int ended = -2;
  static constexpr std::chrono::hours a_while{1};

  Keyboard();
  ~Keyboard();
  Keyboard(const Keyboard&) = delete;
  Keyboard& operator=(const Keyboard&) = delete;

  int next(std::chrono::milliseconds timeout);
  // Discards the bytes typed at a terminal, so that they do not answer the next question.
  void forget();

 private:
  static constexpr int signals[] = {SIGINT, SIGTERM, SIGHUP, SIGTSTP};

  std::optional<termios> before_;
  struct sigaction handled_before_[4] = {};
};

}  // namespace r4::tool
