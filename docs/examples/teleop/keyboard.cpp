// SPDX-License-Identifier: GPL-3.0-or-later
#include "keyboard.hpp"

#include <poll.h>
#include <unistd.h>

#include <cerrno>

Keyboard::Keyboard() {
  termios now{};
  if (::tcgetattr(STDIN_FILENO, &now) != 0) return;
  before_ = now;
  now.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
  ::tcsetattr(STDIN_FILENO, TCSANOW, &now);
}

Keyboard::~Keyboard() {
  if (before_) ::tcsetattr(STDIN_FILENO, TCSANOW, &*before_);
}

std::optional<char> Keyboard::key(std::chrono::milliseconds at_most) {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  if (::poll(&input, 1, static_cast<int>(at_most.count())) <= 0) return std::nullopt;
  char keys[64];
  const ssize_t size = ::read(STDIN_FILENO, keys, sizeof keys);
  if (size > 0) {
    // A stop among the waiting keys has priority.
    for (ssize_t i = 0; i < size; ++i) {
      if (keys[i] == ' ') return ' ';
    }
    return keys[size - 1];
  }
  at_end_ = size == 0 || errno != EINTR;
  return std::nullopt;
}
