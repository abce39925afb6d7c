// SPDX-License-Identifier: GPL-3.0-or-later
// The implementation of States: a bounded queue. The link does not wait for the program.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "blocking/blocking_loop.hpp"
#include "r4link/board.hpp"
#include "r4link/error.hpp"

namespace r4 {

class States::Queue {
 public:
  Queue(StatesOptions options, std::function<void()> on_wait)
      : lossless_(options.lossless),
        most_(options.most != 0  ? options.most
              : options.lossless ? most_lossless
                                 : 1),
        on_wait_(std::move(on_wait)),
        ring_(std::min<std::size_t>(most_, 16)) {}

  void put(const ReceivedState& state) {
    {
      const std::lock_guard lock(mutex_);
      if (ended_) return;
      // After a gap, no state is queued until the gap has been reported.
      if (lossless_ && (gap_ != 0 || count_ == most_)) {
        ++gap_;
        ++missed_;
        return;
      }
      if (count_ == most_) {
        drop_first();
        ++missed_;
      } else if (count_ == ring_.size()) {
        grow();
      }
      ring_[(first_ + count_++) % ring_.size()] = state;
    }
    news_.notify_one();
  }
  void end() {
    const std::lock_guard lock(mutex_);
    ended_ = true;
    news_.notify_all();
  }

  std::optional<ReceivedState> take(Duration timeout) {
    const auto deadline = BlockingLoop::Clock::now() + bounded(timeout);
    std::unique_lock lock(mutex_);
    BlockingLoop::wait_until(lock, news_, deadline, on_wait_,
                             [&] { return ended_ || count_ != 0 || gap_ != 0; });
    if (count_ != 0) {
      const ReceivedState state = ring_[first_];
      drop_first();
      return state;
    }
    if (gap_ == 0) return std::nullopt;
    throw Error(ErrorKind::data, "states()",
                fmt::format("the queue of {} states was full, so the next {} states are lost",
                            most_, std::exchange(gap_, 0)),
                "take the states faster, or enlarge the queue: StatesOptions::most");
  }
  bool ended() const {
    const std::lock_guard lock(mutex_);
    return ended_ && count_ == 0 && gap_ == 0;
  }
  std::uint64_t missed() const {
    const std::lock_guard lock(mutex_);
    return missed_;
  }

 private:
  static constexpr std::size_t most_lossless = 65536;

  void drop_first() {
    first_ = (first_ + 1) % ring_.size();
    --count_;
  }
  // A short queue stays small. At full size, a queue allocates nothing.
  void grow() {
    std::rotate(ring_.begin(), ring_.begin() + static_cast<std::ptrdiff_t>(first_), ring_.end());
    first_ = 0;
    ring_.resize(std::min(most_, 2 * ring_.size()));
  }

  const bool lossless_;
  const std::size_t most_;
  const std::function<void()> on_wait_;
  mutable std::mutex mutex_;  // guards the members below
  std::condition_variable news_;
  std::vector<ReceivedState> ring_;
  std::size_t first_ = 0;
  std::size_t count_ = 0;
  std::uint64_t gap_ = 0;  // states lost after the queued states
  std::uint64_t missed_ = 0;
  bool ended_ = false;
};

}  // namespace r4
