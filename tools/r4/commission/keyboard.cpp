// SPDX-License-Identifier: GPL-3.0-or-later
#include "keyboard.hpp"

#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <iterator>

namespace r4::tool {
namespace {

volatile std::sig_atomic_t interrupted = 0;

void on_signal(int) { interrupted = 1; }

}  // namespace

Keyboard::Keyboard() {
  struct sigaction action = {};
  for (std::size_t i = 0; i < std::size(signals); ++i) {
    action.sa_handler = signals[i] == SIGTSTP ? SIG_IGN : on_signal;  // interrupts poll()
    ::sigaction(signals[i], &action, &handled_before_[i]);
  }
  termios settings{};
  if (::tcgetattr(STDIN_FILENO, &settings) != 0) return;
  before_ = settings;
  settings.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
  ::tcsetattr(STDIN_FILENO, TCSANOW, &settings);
}

Keyboard::~Keyboard() {
  if (before_) ::tcsetattr(STDIN_FILENO, TCSANOW, &*before_);
  for (std::size_t i = 0; i < std::size(signals); ++i) {
    ::sigaction(signals[i], &handled_before_[i], nullptr);
  }
}

int Keyboard::next(std::chrono::milliseconds timeout) {
  // A signal just before poll() is seen at the end of a turn.
  constexpr std::chrono::milliseconds turn{100};
  for (;; timeout -= turn) {
    if (interrupted != 0) return ended;
    pollfd input{STDIN_FILENO, POLLIN, 0};
    const auto wait = timeout < turn ? timeout : turn;
    const int ready = ::poll(&input, 1, static_cast<int>(wait.count()));
    if (ready > 0) {
      unsigned char byte = 0;
      const ssize_t count = ::read(STDIN_FILENO, &byte, 1);
      if (count == 1) return byte;
      if (count == 0 || errno != EINTR) return ended;
    }
    if (timeout <= turn) return nothing;
  }
}

void Keyboard::forget() {
  if (before_) ::tcflush(STDIN_FILENO, TCIFLUSH);
}

}  // namespace r4::tool
