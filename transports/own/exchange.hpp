// SPDX-License-Identifier: GPL-3.0-or-later
// Connects a program's own transport to a link's loop by a thread: calls of the transport may wait.
//     opening ──────────────▶ up ────────────────────────▶ down ─────────▶ ended
//        │   open() returns   ▲   send() throws, or end()  ▲ │    end()
//        │                    └──── open() returns ────────┼─┘
//        └───────────────────────── open() throws ─────────┘
// In `down`, the thread calls open() five times a second. The loop waits for the first open() only.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "r4link/carrier.hpp"

namespace r4 {

// `Own`: open(received), send(item) and close(), which may throw. `Outbox`: the type Item, clear()
// and std::optional<Item> next(Time), which takes the next item to send; for dropped(), `dropped`.
template <class Own, class Outbox>
class Exchange : public std::enable_shared_from_this<Exchange<Own, Outbox>> {
 public:
  using Clock = std::chrono::steady_clock;
  using Item = typename Outbox::Item;
  static constexpr std::size_t most_received = 1024;
  static constexpr std::chrono::milliseconds pause{200};  // between two calls of open()
  static constexpr std::chrono::seconds end_patience{1};

  // `news()`, on any thread, under the lock: items wait, or the transport went up or down.
  Exchange(std::string name, std::unique_ptr<Own> own, std::unique_ptr<Outbox> outbox,
           std::function<void()> news)
      : name_(std::move(name)),
        own_(std::move(own)),
        outbox_(std::move(outbox)),
        news_(std::move(news)) {}

  // --- on the loop

  // The first call starts the thread and waits for open(). A later call drops the items that were
  // received before it. Throws Error if the transport is not up.
  void start() {
    std::unique_lock lock(mutex_);
    if (!thread_.joinable()) {
      thread_ = std::thread([self = this->shared_from_this()] { self->run(); });
      changed_.wait(lock, [this] { return state_ != State::opening; });
    } else {
      inbox_.clear();
    }
    if (state_ != State::up) throw Error(problem_);
  }
  // Sends the waiting items and closes the transport. A hanging call continues in its thread.
  void end() noexcept {
    if (!thread_.joinable()) return;
    std::unique_lock lock(mutex_);
    ending_ = true;
    news_ = nullptr;
    changed_.notify_all();
    const bool ended =
        changed_.wait_for(lock, end_patience, [this] { return state_ == State::ended; });
    lock.unlock();
    ended ? thread_.join() : thread_.detach();
  }
  template <class Put>
  bool send(Put put) {
    const std::lock_guard lock(mutex_);
    if (state_ != State::up) return false;
    put(*outbox_);
    changed_.notify_all();
    return true;
  }
  // Oldest first, at most `most`; none from before a failure. After `most` items, news() follows.
  std::vector<Item> take(std::size_t most) {
    const std::lock_guard lock(mutex_);
    if (state_ != State::up) return {};
    std::vector<Item> items;
    while (items.size() < most && !inbox_.empty()) {
      items.push_back(std::move(inbox_.front()));
      inbox_.pop_front();
    }
    if (items.size() == most && news_) news_();
    return items;
  }
  bool up() const {
    const std::lock_guard lock(mutex_);
    return state_ == State::up;
  }
  Problem problem() const {
    const std::lock_guard lock(mutex_);
    return problem_;
  }
  std::uint64_t sent() const {
    const std::lock_guard lock(mutex_);
    return sent_;
  }
  std::uint64_t dropped() const {
    const std::lock_guard lock(mutex_);
    return outbox_->dropped;
  }
  std::uint64_t overflows() const {
    const std::lock_guard lock(mutex_);
    return overflows_;
  }

  // --- on any thread

  void received(std::uint64_t opening, Item item) {
    const std::lock_guard lock(mutex_);
    if (ending_ || opening != opening_) return;
    if (inbox_.size() == most_received) {
      ++overflows_;
      return;
    }
    inbox_.push_back(std::move(item));
    if (inbox_.size() == 1) news_();
  }

 private:
  enum class State : std::uint8_t { opening, up, down, ended };

  void run() {
    std::unique_lock lock(mutex_);
    change(open(lock) ? State::up : State::down);
    while (!(ending_ && state_ == State::down)) {
      if (state_ == State::down) {
        const bool ends = changed_.wait_for(lock, pause, [this] { return ending_; });
        if (!ends && open(lock)) change(State::up);
      } else if (std::optional<Item> item = outbox_->next(Clock::now())) {
        if (call(lock, [&] { own_->send(*item); })) {
          ++sent_;
          continue;
        }
        change(State::down);
        const Problem why = problem_;
        call(lock, [this] { own_->close(); });
        problem_ = why;
      } else if (ending_) {
        call(lock, [this] { own_->close(); });
        change(State::down);
      } else {
        changed_.wait(lock);
      }
    }
    change(State::ended);
  }
  bool open(std::unique_lock<std::mutex>& lock) {
    inbox_.clear();
    outbox_->clear();
    const std::uint64_t opening = ++opening_;
    return call(lock, [this, opening] {
      own_->open([weak = this->weak_from_this(), opening](Item item) {
        if (const auto self = weak.lock()) self->received(opening, std::move(item));
      });
    });
  }
  template <class Function>
  bool call(std::unique_lock<std::mutex>& lock, Function function) {
    lock.unlock();
    std::optional<Problem> thrown;
    try {
      function();
    } catch (const Error& error) {
      thrown = error.problem();
    } catch (const std::exception& error) {
      thrown = Problem{ErrorKind::open, name_, error.what(), ""};
    }
    lock.lock();
    if (thrown) problem_ = std::move(*thrown);
    return !thrown;
  }
  void change(State state) {
    state_ = state;
    changed_.notify_all();
    if (news_) news_();
  }

  const std::string name_;
  const std::unique_ptr<Own> own_;
  const std::unique_ptr<Outbox> outbox_;
  mutable std::mutex mutex_;  // protects the outbox and the members below
  std::function<void()> news_;
  std::condition_variable changed_;
  State state_ = State::opening;
  bool ending_ = false;
  Problem problem_{ErrorKind::open, "", "", ""};
  std::uint64_t opening_ = 0;  // the number of calls of open()
  std::deque<Item> inbox_;
  std::uint64_t sent_ = 0;
  std::uint64_t overflows_ = 0;
  std::thread thread_;
};

}  // namespace r4
