// SPDX-License-Identifier: GPL-3.0-or-later
// The thread on which the links of a Board or a Fleet run, and the calls of other threads that wait for it.
//
//     a thread of the program           the loop's thread
//     run(call) ---- posted ---->       begin: the call's start(), with the time that is left
//        waits  <--- finish() ---       each of its parts ends
//
// A caller may give up: at its deadline, or when on_wait() throws. What the loop has not begun by then, it never
// begins; what it has begun is cancelled. A stop goes out however late it is.
#pragma once

#include <algorithm>
#include <asio/bind_cancellation_slot.hpp>
#include <asio/cancellation_signal.hpp>
#include <asio/executor_work_guard.hpp>
#include <asio/io_context.hpp>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>

#include "../measurement/boot_clock.hpp"
#include "r4link/error.hpp"

namespace r4 {

class BlockingLoop {
 public:
  using Clock = std::chrono::steady_clock;
  using Duration = std::chrono::milliseconds;
  static constexpr Duration wait_interval{50};
  // So long does close() wait for the boards to say that they are free.
  static constexpr Duration farewell_limit{100};

  // Held by both sides, since the caller may give up.
  struct Call;
  using CallPtr = std::shared_ptr<Call>;
  struct Call {
    std::string text;  // what was asked for, in errors
    bool stop = false;
    // On the loop. Each part ends by finish(), and is cancelled by a signal of its own.
    std::function<void(const CallPtr& call, Duration left)> start;
    std::deque<asio::cancellation_signal> cancelled;
    std::size_t parts = 1;  // that have not ended
    bool begun = false;
    bool abandoned = false;
    std::condition_variable ended;
    const Clock::time_point called = Clock::now();
  };

  // How errors name it: "board" or "fleet", and what to do if its thread does not answer.
  struct Name {
    std::string_view thing;
    std::string_view fix;
  };

  BlockingLoop(Name name, int concurrency, std::function<void()> wait)
      : on_wait(std::move(wait)), io(concurrency), name_(name) {}
  BlockingLoop(const BlockingLoop&) = delete;
  BlockingLoop& operator=(const BlockingLoop&) = delete;

  // --- on any thread

  // Waits until all parts of the call have ended. Throws if they do not in time, if it is closed, and what on_wait()
  // throws.
  void run(const CallPtr& call, Duration timeout);
  // Has the call begin, with Board::default_timeout, and does not wait. Does nothing if the loop is closed.
  void run_unawaited(const CallPtr& call);
  // Does `action` on the loop, between other things, and waits until it is done. False if it is closed. Throws if the
  // loop does not begin it in time (then it never will), and what `action` throws.
  bool run_on_loop(std::string_view what, const std::function<void()>& action);
  // Waits until `arrived` (asked under the lock) is true. False if it was not in time. A sleep of this computer is part
  // of the time, though the deadline stands still meanwhile. Throws if it is closed, an error about what() returns; that is
  // called under the lock.
  template <class What, class Predicate>
  bool wait_for_news(What what, Duration timeout, Predicate arrived) {
    const SleepWatch slept;
    std::unique_lock lock(mutex);
    const bool woken = wait_until(lock, news, Clock::now() + bounded(timeout),
                                  [&] { return closed || arrived(); });
    if (closed) throw closed_error(what());
    return woken && slept.time() <= bounded(timeout);
  }
  // Waits for what `done` is asked under the lock; false at the deadline. Throws what on_wait() throws.
  template <class Predicate>
  bool wait_until(std::unique_lock<std::mutex>& lock, std::condition_variable& changed,
                  Clock::time_point deadline, Predicate done) {
    if (!on_wait) return changed.wait_until(lock, deadline, done);
    while (!changed.wait_until(lock, std::min(deadline, Clock::now() + wait_interval), done)) {
      if (Clock::now() >= deadline) return false;
      lock.unlock();
      on_wait();
      lock.lock();
    }
    return true;
  }

  // At most a day: that is as good as for ever, and cannot overflow.
  static Duration bounded(Duration timeout) {
    return std::clamp<Duration>(timeout, Duration{0}, std::chrono::hours{24});
  }
  Error closed_error(std::string_view what) const;

  // Throws std::system_error if the system has no thread left.
  void start(std::function<void()> loop) { thread_ = std::thread(std::move(loop)); }
  // Has the loop begin to end, by `shut`, if it has not, and waits for its end. Idempotent.
  void close(std::function<void()> shut);

  // --- on the loop

  // `fill`: sets the results, under the lock.
  template <class Fill>
  void finish(Call& call, Fill fill) {
    const std::lock_guard lock(mutex);
    fill();
    if (--call.parts == 0) call.ended.notify_all();
  }
  // For the beginning of `shut`: from now on nothing more is put on the loop. False if it was closed before. Calls `last`
  // under the lock.
  template <class Last>
  bool mark_closed(Last last) {
    {
      const std::lock_guard lock(mutex);
      if (closed) return false;
      closed = true;
      last();
    }
    news.notify_all();
    return true;
  }
  // For the end of `shut`: carries out what is on the loop, then ends it.
  void end_loop();

  const std::function<void()> on_wait;
  asio::io_context io;
  // What both sides see.
  std::mutex mutex;
  std::condition_variable news;  // what wait_for_news() may be asked for, or `closed`, has changed
  bool closed = false;

 protected:
  ~BlockingLoop() = default;

 private:
  void begin(const CallPtr& call, Clock::time_point deadline);
  Error blocked_error(std::string_view what, std::string_view instead, std::string_view fix) const;

  const Name name_;
  asio::executor_work_guard<asio::io_context::executor_type> work_{io.get_executor()};
  std::thread thread_;
  std::mutex joining_;
};

}  // namespace r4
