// SPDX-License-Identifier: GPL-3.0-or-later
// What is published, on a thread of its own: a subscriber that blocks, or a network that is full, holds up this
// thread alone, never the boards' links.
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
  // Returns false to be tried again; `last`: it will not be.
  using Attempt = std::function<bool(bool last)>;

  // For so many jobs that wait; the oldest goes where there is no room.
  explicit Outbox(std::size_t room = 256);
  ~Outbox() { stop(); }
  Outbox(const Outbox&) = delete;
  Outbox& operator=(const Outbox&) = delete;

  // Never waits.
  void push(Job job);
  // Tried every few milliseconds, for a tenth of a second; the jobs go on meanwhile.
  void push_attempt(Attempt attempt);
  // Ends behind the job that runs; what waits is dropped. Idempotent.
  void stop();
  // Jobs that were dropped for want of room.
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
  // Of the thread.
  std::deque<Retry> retries_;
  Clock::time_point next_try_{};
  std::thread thread_;
};

}  // namespace r4::tool::ros2
