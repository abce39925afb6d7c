// SPDX-License-Identifier: GPL-3.0-or-later
// Publishes on its own thread: a blocked subscriber or network does not delay the boards.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>

namespace r4::tool::ros2 {

class Outbox {
 public:
  using Job = std::function<void()>;
  // If `last` is false and an attempt returns false, the attempt is repeated.
  using Attempt = std::function<bool(bool last)>;

  // `room`: most waiting jobs; the oldest is dropped.
  explicit Outbox(std::size_t room = 256);
  ~Outbox() { stop(); }
  Outbox(const Outbox&) = delete;
  Outbox& operator=(const Outbox&) = delete;

  // Never blocks.
  void push(Job job);
  // Repeats the attempt every few milliseconds, for up to 100 ms. Other jobs continue meanwhile.
  void push_attempt(Attempt attempt);
  // Ends after the current job and drops waiting jobs. Idempotent.
  void stop();
  std::uint64_t lost() const;

 private:
  using Clock = std::chrono::steady_clock;
  struct Retry {
    Attempt attempt;
    Clock::time_point end;
  };

  void run();
  void begin(Attempt attempt);
  void try_again();

  const std::size_t room_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Job> waiting_;
  std::uint64_t lost_ = 0;
  bool ending_ = false;
  // Used by the thread only:
  std::deque<Retry> retries_;
  Clock::time_point next_try_{};
  std::thread thread_;
};

}  // namespace r4::tool::ros2
