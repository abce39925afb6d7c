// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <asio/io_context.hpp>
#include <asio/signal_set.hpp>
#include <chrono>
#include <csignal>
#include <optional>
#include <system_error>

#include "timer.hpp"

namespace r4::tool {

// SIGINT, SIGTERM and SIGHUP stop `io`, so the command ends normally. A signal that was ignored
// when the program started stays ignored, because nohup and `&` in a shell script rely on it.
class RunEnd {
 public:
  explicit RunEnd(asio::io_context& io) : io_(io), signals_(io), limit_(io) {}

  // Before this call a signal ends the program at once. `duration` is the longest run, if limited.
  void watch(const std::optional<std::chrono::milliseconds>& duration = std::nullopt) {
    for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
      if (!is_ignored(number)) signals_.add(number);
    }
    signals_.async_wait([this](const std::error_code& error, int number) {
      if (!error) signal_ = number;
      io_.stop();
    });
    if (duration) limit_.after(*duration, [this] { io_.stop(); });
  }

  // If a signal has ended the run, ends the program by this signal. So a shell also ends its
  // script: after an exit code, the shell would continue the script.
  void raise_again() {
    if (signal_ == 0) return;
    signals_.clear();
    std::raise(signal_);
  }

 private:
  static bool is_ignored(int number) {
    struct sigaction action {};
    return ::sigaction(number, nullptr, &action) == 0 && action.sa_handler == SIG_IGN;
  }

  asio::io_context& io_;
  asio::signal_set signals_;
  Timer limit_;
  int signal_ = 0;
};

}  // namespace r4::tool
