// SPDX-License-Identifier: GPL-3.0-or-later
// The states of a board, one after the other, for a loop of Python's.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <utility>

#include "r4link/link.hpp"

namespace r4::python {

// As many wait as it is asked for; the oldest gives way. No GIL is needed.
class States {
 public:
  explicit States(std::size_t most) : most_(most) {}

  void put(const ReceivedState& state) {
    {
      const std::lock_guard lock(mutex_);
      if (waiting_.size() == most_) {
        waiting_.pop_front();
        ++dropped_;
      }
      waiting_.push_back(state);
    }
    news_.notify_one();
  }
  // The board was closed: what waits can still be taken.
  void end() {
    {
      const std::lock_guard lock(mutex_);
      ended_ = true;
    }
    news_.notify_all();
  }
  // The next one; nothing at the timeout, or when it has ended. Throws what `on_wait` does, every 50 ms.
  std::optional<ReceivedState> take(std::chrono::milliseconds timeout,
                                    const std::function<void()>& on_wait) {
    const auto deadline = Clock::now() + timeout;
    std::unique_lock lock(mutex_);
    const auto news = [&] { return ended_ || !waiting_.empty(); };
    while (!news_.wait_until(lock, std::min(deadline, Clock::now() + interval), news)) {
      if (Clock::now() >= deadline) return std::nullopt;
      lock.unlock();
      on_wait();
      lock.lock();
    }
    if (waiting_.empty()) return std::nullopt;
    const ReceivedState state = waiting_.front();
    waiting_.pop_front();
    return state;
  }
  bool ended() {
    const std::lock_guard lock(mutex_);
    return ended_ && waiting_.empty();
  }
  std::uint64_t dropped() {
    const std::lock_guard lock(mutex_);
    return dropped_;
  }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::milliseconds interval{50};

  const std::size_t most_;
  std::mutex mutex_;
  std::condition_variable news_;
  std::deque<ReceivedState> waiting_;
  std::uint64_t dropped_ = 0;
  bool ended_ = false;
};

}  // namespace r4::python
