// SPDX-License-Identifier: GPL-3.0-or-later
#include "outbox.hpp"

#include <utility>

namespace r4::tool::ros2 {

Outbox::Outbox(std::size_t room) : room_(room), thread_([this] { run(); }) {}

void Outbox::push(Job job) {
  {
    const std::lock_guard lock(mutex_);
    if (waiting_.size() == room_) {
      waiting_.pop_front();
      ++lost_;
    }
    waiting_.push_back(std::move(job));
  }
  changed_.notify_one();
}

void Outbox::stop() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  changed_.notify_one();
  if (thread_.joinable()) thread_.join();
}

std::uint64_t Outbox::lost() const {
  const std::lock_guard lock(mutex_);
  return lost_;
}

void Outbox::run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return ending_ || !waiting_.empty(); });
    if (ending_) return;
    const Job job = std::move(waiting_.front());
    waiting_.pop_front();
    lock.unlock();
    job();
    lock.lock();
  }
}

}  // namespace r4::tool::ros2
