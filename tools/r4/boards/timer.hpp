// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <asio/io_context.hpp>
#include <asio/steady_timer.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <system_error>
#include <utility>

namespace r4::tool {

// One task at a time. A cancelled or replaced task never runs. A destroyed timer runs no task.
class Timer {
 public:
  using Clock = std::chrono::steady_clock;

  explicit Timer(asio::io_context& io) : timer_(io) {}
  ~Timer() = default;
  Timer(const Timer&) = delete;
  Timer& operator=(const Timer&) = delete;

  template <class Task>
  void at(Clock::time_point time, Task task) {
    timer_.expires_at(time);
    turn_ = std::make_shared<int>();
    timer_.async_wait(
        [turn = std::weak_ptr(turn_), task = std::move(task)](const std::error_code&) mutable {
          if (!turn.expired()) task();
        });
  }
  template <class Task>
  void after(Clock::duration time, Task task) {
    at(Clock::now() + time, std::move(task));
  }
  // Runs the task one `period` after the call and one `period` after each end of the task.
  void every(Clock::duration period, std::function<void()> task) {
    after(period, [this, period, task = std::move(task)]() mutable {
      const std::weak_ptr turn(turn_);
      task();
      if (!turn.expired()) every(period, std::move(task));
    });
  }
  void cancel() {
    turn_.reset();
    timer_.cancel();
  }

 private:
  asio::steady_timer timer_;
  std::shared_ptr<int> turn_;
};

}  // namespace r4::tool
