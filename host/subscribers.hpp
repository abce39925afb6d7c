// SPDX-License-Identifier: GPL-3.0-or-later
// Callbacks, several of a kind, each with a handle by which it is ended.
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

// What stands behind a Subscription.
class Subscriber {
 public:
  virtual ~Subscriber() = default;
  void end() {
    // In a fork nothing calls it, and a thread that was calling it then holds the lock for ever.
    if (::getpid() != process_) return;
    ended_ = true;
    std::shared_ptr<void> gone;            // destroyed without the lock
    const std::lock_guard lock(running_);  // waits for a call in another thread
    if (!called_) gone = take();           // else when that call is over
  }
  bool ended() const { return ended_; }

 protected:
  // Calls `function` unless this has ended.
  template <class Function>
  void call(Function function) {
    std::shared_ptr<void> gone;
    const std::lock_guard lock(running_);
    if (ended_) return;
    const Call under_way(*this, gone);
    function();
  }
  // Takes the callback out, with what it has captured.
  virtual std::shared_ptr<void> take() = 0;

 private:
  // Also where the callback throws.
  class Call {
   public:
    Call(Subscriber& subscriber, std::shared_ptr<void>& gone)
        : subscriber_(subscriber),
          gone_(gone),
          outermost_(!std::exchange(subscriber.called_, true)) {}
    Call(const Call&) = delete;
    Call& operator=(const Call&) = delete;
    ~Call() {
      if (!outermost_) return;
      subscriber_.called_ = false;
      if (subscriber_.ended_) gone_ = subscriber_.take();
    }

   private:
    Subscriber& subscriber_;
    std::shared_ptr<void>& gone_;
    const bool outermost_;
  };

  const pid_t process_ = ::getpid();
  std::recursive_mutex running_;
  std::atomic<bool> ended_{false};
  bool called_ = false;
};

// The callbacks of one kind. Added from any thread, called from one; a call allocates nothing.
template <class... Arguments>
class Subscribers {
 public:
  using Function = std::function<void(const Arguments&...)>;

  class One final : public Subscriber {
   public:
    explicit One(Function function) : function_(std::make_shared<Function>(std::move(function))) {}
    void operator()(const Arguments&... arguments) {
      call([&] { (*function_)(arguments...); });
    }

   private:
    std::shared_ptr<void> take() override { return std::move(function_); }
    std::shared_ptr<Function> function_;
  };

  // An empty function is no callback: its handle has ended.
  Subscription add(Function function) {
    if (!function) return {};
    const auto one = std::make_shared<One>(std::move(function));
    add(one);
    return Subscription(one);
  }
  void add(const std::shared_ptr<One>& one) {
    const std::lock_guard lock(mutex_);
    List fresh;
    for (const auto& each : *list_) {
      if (!each->ended()) fresh.push_back(each);
    }
    fresh.push_back(one);
    list_ = std::make_shared<const List>(std::move(fresh));
  }

  // Those that are added meanwhile are not called.
  void operator()(const Arguments&... arguments) const {
    each([&](One& one) { one(arguments...); });
  }
  template <class Action>
  void each(Action action) const {
    const std::shared_ptr<const List> now = list();
    for (const auto& one : *now) action(*one);
  }

 private:
  using List = std::vector<std::shared_ptr<One>>;
  std::shared_ptr<const List> list() const {
    const std::lock_guard lock(mutex_);
    return list_;
  }

  mutable std::mutex mutex_;
  std::shared_ptr<const List> list_ = std::make_shared<const List>();
};

}  // namespace r4
