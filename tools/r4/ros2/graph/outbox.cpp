// SPDX-License-Identifier: GPL-3.0-or-later
#include "outbox.hpp"

#include <utility>

namespace r4::tool::ros2 {
namespace {

using namespace std::chrono_literals;

constexpr auto between_tries = 5ms;
constexpr auto longest_trying = 100ms;
constexpr std::size_t most_retries = 16;

}  // namespace

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

void Outbox::push_attempt(Attempt attempt) {
  push([this, attempt = std::move(attempt)] { begin(attempt); });
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
    const auto wanted = [this] { return ending_ || !waiting_.empty(); };
    if (retries_.empty()) {
      changed_.wait(lock, wanted);
    } else {
      changed_.wait_until(lock, next_try_, wanted);
    }
    if (ending_) return;
    Job job;
    if (!waiting_.empty()) {
      job = std::move(waiting_.front());
      waiting_.pop_front();
    }
    lock.unlock();
    if (job) job();
    try_again();
    lock.lock();
  }
}

void Outbox::begin(Attempt attempt) {
  if (attempt(false)) return;
  if (retries_.size() == most_retries) {
    retries_.front().attempt(true);
    retries_.pop_front();
  }
  if (retries_.empty()) next_try_ = Clock::now() + between_tries;
  retries_.push_back({std::move(attempt), Clock::now() + longest_trying});
}

void Outbox::try_again() {
  const Clock::time_point now = Clock::now();
  if (retries_.empty() || now < next_try_) return;
  next_try_ = now + between_tries;
  std::erase_if(retries_, [now](const Retry& each) { return each.attempt(now >= each.end); });
}

}  // namespace r4::tool::ros2
