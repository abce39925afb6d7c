// SPDX-License-Identifier: GPL-3.0-or-later
// The callbacks of one kind, each with a handle that ends it.
#pragma once

#include <unistd.h>

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "r4link/subscription.hpp"

namespace r4 {

class Subscriber {
 public:
  virtual ~Subscriber() = default;
  void end() {
    // After a fork, no thread runs the callback, and a lock of another thread is never released.
    if (::getpid() != process_) return;
    ended_ = true;
    std::shared_ptr<void> gone;            // destroyed without the lock
    const std::lock_guard lock(running_);  // waits for a running call
    gone = take();
  }
  bool ended() const { return ended_; }

 protected:
  // Removes the callback with its captures. Under the lock.
  virtual std::shared_ptr<void> take() = 0;

  std::recursive_mutex running_;

 private:
  const pid_t process_ = ::getpid();
  std::atomic<bool> ended_{false};
};

// Callbacks are added from any thread and called from one thread. A call allocates nothing.
template <class... Arguments>
class Subscribers {
 public:
  using Function = std::function<void(const Arguments&...)>;

  class One final : public Subscriber {
   public:
    explicit One(Function function) : function_(std::make_shared<Function>(std::move(function))) {}
    void operator()(const Arguments&... arguments) {
      // Keeps the captures during the call. Destroyed after the lock is released.
      std::shared_ptr<Function> called;
      const std::lock_guard lock(running_);
      if (ended()) return;
      called = function_;
      (*called)(arguments...);
    }

   private:
    std::shared_ptr<void> take() override { return std::move(function_); }
    std::shared_ptr<Function> function_;
  };

  // An empty function adds no callback, and the returned handle is ended.
  Subscription add(Function function) {
    if (!function) return {};
    const auto one = std::make_shared<One>(std::move(function));
    add(one);
    return Subscription(one);
  }
  void add(const std::shared_ptr<One>& one) {
    const std::lock_guard lock(mutex_);
    List fresh = *list_;
    std::erase_if(fresh, [](const auto& each) { return each->ended(); });
    fresh.push_back(one);
    list_ = std::make_shared<const List>(std::move(fresh));
  }

  // Skips callbacks that are added during the call.
  template <class Action>
  void each(Action action) const {
    std::unique_lock lock(mutex_);
    const std::shared_ptr<const List> now = list_;
    lock.unlock();
    for (const auto& one : *now) action(*one);
  }

 private:
  using List = std::vector<std::shared_ptr<One>>;

  mutable std::mutex mutex_;
  std::shared_ptr<const List> list_ = std::make_shared<const List>();
};

}  // namespace r4
