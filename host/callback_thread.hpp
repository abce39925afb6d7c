// SPDX-License-Identifier: GPL-3.0-or-later
// The thread on which the callbacks of a Board run, beside the thread of its link.
//     the link's loop --notify()--> notices, 64 at most --> the callbacks, one at a time
//
// A callback may wait for the board: heartbeats and commands continue. But a hanging callback
// leaves the robot unattended, so the loop stops the heartbeats when busy_for() exceeds a limit.
//
// The link does not wait for callbacks. A newer state replaces a waiting state. From 32 waiting
// notices on, refusals and warnings are dropped, at 64 the oldest notice. notify() allocates
// nothing.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "r4link/board.hpp"
#include "r4link/carrier.hpp"
#include "session/session.hpp"
#include "subscribers.hpp"

namespace r4 {

// More than 15 members, grouped by the thread that may touch them.
class CallbackThread {
 public:
  using Clock = std::chrono::steady_clock;
  struct Restart {};
  struct UartNews {
    int channel;
  };
  using Notice = std::variant<Restart, ReceivedState, LinkStatus, CarrierEvent, PathStatus,
                              DisarmCause, RefusedPost, UartNews>;
  static constexpr std::size_t capacity = 64;

  // `on_end` is called on this thread after each callback, with the callback's run time.
  // `take_uart` removes and returns the waiting bytes.
  CallbackThread(std::function<void(Clock::duration)> on_end,
                 std::function<Board::UartData(int channel)> take_uart);
  ~CallbackThread();
  CallbackThread(const CallbackThread&) = delete;
  CallbackThread& operator=(const CallbackThread&) = delete;

  // Keeps `owner` until the thread ends.
  void start(std::shared_ptr<void> owner);
  // After the return no callback runs, except a callback that called stop().
  void stop();

  void notify(Notice notice);
  std::optional<Clock::duration> busy_for() const;

  // Adds a callback, which is called with the newest notice, if any, and with each new notice.
  template <class Kind>
  Subscription add(std::function<void(const Kind&)> callback) {
    return add(std::get<Subscribers<Kind>>(callbacks_), std::move(callback));
  }
  Subscription add_restart(std::function<void()> callback) {
    if (!callback) return {};
    return add<Restart>([callback = std::move(callback)](const Restart&) { callback(); });
  }
  Subscription add_uart(int channel, std::function<void(const Board::UartData&)> callback) {
    return add(uart_callbacks_[channel - 1], std::move(callback));
  }

 private:
  // `action` runs after notice number `after`.
  struct Task {
    std::uint64_t after;
    std::function<void()> action;
  };

  template <class Kind>
  Subscription add(Subscribers<Kind>& callbacks, std::function<void(const Kind&)> callback) {
    if (!callback) return {};
    const auto one = std::make_shared<typename Subscribers<Kind>::One>(std::move(callback));
    {
      const std::lock_guard lock(mutex_);
      if (ended_) return {};
      // Queued among the notices, so that the callback gets each notice exactly once.
      tasks_.push_back({told_, [this, &callbacks, one] {
                          callbacks.add(one);
                          call_first(*one);
                        }});
      news_.notify_one();  // under the lock: the callback may run at once and destroy this
    }
    return Subscription(one);
  }
  void run();
  bool take(Notice& notice, std::function<void()>& task);
  void call(const Notice& notice);
  // If a callback closes the board, later callbacks are not called.
  template <class Kind>
  void call_each(const Subscribers<Kind>& callbacks, const Kind& news) {
    callbacks.each([&](auto& one) {
      if (!ended_) one(news);
    });
  }
  void call_first(Subscribers<ReceivedState>::One& one) {
    if (state_.any()) one(state_);
  }
  void call_first(Subscribers<LinkStatus>::One& one) { one(link_); }
  void call_first(Subscribers<CarrierEvent>::One& one) {
    if (event_) one(*event_);
    if (warning_ && !ended_) one(*warning_);
  }
  void call_first(Subscribers<DisarmCause>::One& one) { one(arming_); }
  void call_first(Subscriber&) {}
  void keep(const Restart&) { state_ = ReceivedState(); }
  void keep(const ReceivedState& state) { state_ = state; }
  void keep(const LinkStatus& link) { link_ = link; }
  void keep(const CarrierEvent& event);
  void keep(DisarmCause cause) { arming_ = cause; }
  template <class Kind>
  void keep(const Kind&) {}

  const std::function<void(Clock::duration)> on_end_;
  const std::function<Board::UartData(int)> take_uart_;
  std::thread thread_;
  std::atomic<std::thread::id> id_{};
  std::mutex joining_;

  // Used only on this thread: the callbacks and the newest notices.
  std::tuple<Subscribers<Restart>, Subscribers<ReceivedState>, Subscribers<LinkStatus>,
             Subscribers<CarrierEvent>, Subscribers<PathStatus>, Subscribers<DisarmCause>,
             Subscribers<RefusedPost>>
      callbacks_;
  Subscribers<Board::UartData> uart_callbacks_[uart_channels];
  ReceivedState state_;
  LinkStatus link_;
  std::optional<CarrierEvent> event_;    // up or down
  std::optional<CarrierEvent> warning_;  // since `event_`
  DisarmCause arming_ = DisarmCause::not_yet;

  mutable std::mutex mutex_;  // guards the members below; ended_ is also read without it
  std::condition_variable news_;
  std::atomic<bool> ended_{false};
  std::vector<Notice> ring_;
  std::uint64_t told_ = 0;   // notices so far; the newest is at (told_ - 1) % capacity
  std::uint64_t taken_ = 0;  // notices that were taken or dropped
  std::deque<Task> tasks_;
  std::optional<Clock::time_point> busy_since_;
};

}  // namespace r4
