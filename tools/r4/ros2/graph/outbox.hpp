// SPDX-License-Identifier: GPL-3.0-or-later
// What is published, on a thread of its own: a subscriber that blocks, or a network that is full, holds up this
// thread alone, never the boards' links.
#pragma once

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

  // For so many jobs that wait; the oldest goes where there is no room.
  explicit Outbox(std::size_t room = 256);
  ~Outbox() { stop(); }
  Outbox(const Outbox&) = delete;
  Outbox& operator=(const Outbox&) = delete;

  // Never waits.
  void push(Job job);
  // Ends behind the job that runs; what waits is dropped. Idempotent.
  void stop();
  // Jobs that were dropped for want of room.
  std::uint64_t lost() const;

 private:
  void run();

  const std::size_t room_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Job> waiting_;
  std::uint64_t lost_ = 0;
  bool ending_ = false;
  std::thread thread_;
};

}  // namespace r4::tool::ros2
