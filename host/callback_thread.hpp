// SPDX-License-Identifier: GPL-3.0-or-later
// The thread on which the callbacks of a Board run, beside the thread of its link.
//
//     the link's loop --tell()--> notices, 64 at most --> the callbacks, one at a time
//
// So a callback may take its time, and may wait for the board: heartbeats and commands go on. It may
// not take for ever: busy_for() tells the loop how long one has run, and after a limit the loop stops
// the heartbeats, for nobody looks after the robot.
//
// Nothing here waits for a callback. A state that waits is replaced by the next one. Refusals and warnings
// are left out where 32 notices wait; of the others, the oldest gives way where 64 do. tell() allocates
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
#include <utility>
#include <variant>
#include <vector>

#include "r4link/board.hpp"
#include "r4link/carrier.hpp"
#include "session/session.hpp"
#include "subscribers.hpp"

namespace r4 {

// It has more than 15 members: a list of callbacks for each of eight kinds, and the others grouped by the
// thread that may touch them.
class CallbackThread {
 public:
  using Clock = std::chrono::steady_clock;
  struct Restart {};
  // Bytes of a UART wait for its callbacks.
  struct UartNews {
    int channel;
  };
  using Notice = std::variant<Restart, ReceivedState, LinkStatus, CarrierEvent, PathStatus,
                              DisarmCause, RefusedPost, UartNews>;
  static constexpr std::size_t capacity = 64;

  // `on_end`: a callback has ended that ran for so long; called on this thread.
  explicit CallbackThread(std::function<void(Clock::duration)> on_end);
  ~CallbackThread();
  CallbackThread(const CallbackThread&) = delete;
  CallbackThread& operator=(const CallbackThread&) = delete;

  // Takes the bytes that wait. Before start().
  void take_uart(std::function<Board::UartData(int channel)> take) { take_uart_ = std::move(take); }
  // `owner` is kept until the thread ends.
  void start(std::shared_ptr<void> owner);
  // No callback runs any more when this returns, unless it is called in one; none is called again.
  void stop();
  // Is this the callbacks' thread?
  bool on_it() const { return std::this_thread::get_id() == id_.load(); }

  void tell(Notice notice);
  // How long the callback that runs now has run; nothing if none does.
  std::optional<Clock::duration> busy_for() const;

  // Adds a callback. It is told what there is already, then what comes next.
  Subscription on_state(Subscribers<ReceivedState>::Function callback);
  Subscription on_link(Subscribers<LinkStatus>::Function callback);
  Subscription on_event(Subscribers<CarrierEvent>::Function callback);
  Subscription on_path(Subscribers<PathStatus>::Function callback);
  Subscription on_restart(Subscribers<>::Function callback);
  Subscription on_arming(Subscribers<DisarmCause>::Function callback);
  Subscription on_refused(Subscribers<RefusedPost>::Function callback);
  Subscription on_uart(int channel, Subscribers<Board::UartData>::Function callback);

 private:
  // Something to be done between two notices: behind the first `behind` of all.
  struct Task {
    std::uint64_t behind;
    std::function<void()> action;
  };

  template <class Kind, class Function, class Tell>
  Subscription add(Kind& kind, Function callback, Tell tell);
  void run();
  bool take(Notice& notice, std::function<void()>& task);
  void call(const Notice& notice);
  // The one before may have closed the board.
  template <class... Arguments>
  void call_each(const Subscribers<Arguments...>& callbacks, const Arguments&... arguments) {
    callbacks.each([&](auto& one) {
      if (!ended_) one(arguments...);
    });
  }

  const std::function<void(Clock::duration)> on_end_;
  std::function<Board::UartData(int)> take_uart_;
  std::thread thread_;
  std::atomic<std::thread::id> id_{};
  std::mutex joining_;

  // Of the thread: the callbacks, and what they were told last.
  Subscribers<ReceivedState> state_callbacks_;
  Subscribers<LinkStatus> link_callbacks_;
  Subscribers<CarrierEvent> event_callbacks_;
  Subscribers<PathStatus> path_callbacks_;
  Subscribers<> restart_callbacks_;
  Subscribers<DisarmCause> arming_callbacks_;
  Subscribers<RefusedPost> refused_callbacks_;
  Subscribers<Board::UartData> uart_callbacks_[uart_channels];
  ReceivedState state_;
  LinkStatus link_;
  std::optional<CarrierEvent> event_;    // up or down
  std::optional<CarrierEvent> warning_;  // since then
  DisarmCause arming_ = DisarmCause::not_yet;

  mutable std::mutex mutex_;  // of what follows; ended_ is read without it, too
  std::condition_variable news_;
  std::atomic<bool> ended_{false};
  std::vector<Notice> ring_;
  std::uint64_t told_ = 0;   // notices so far; the newest is ring_[(told_ - 1) % capacity]
  std::uint64_t taken_ = 0;  // of them, taken out or dropped
  std::deque<Task> tasks_;
  std::optional<Clock::time_point> busy_since_;
};

}  // namespace r4
