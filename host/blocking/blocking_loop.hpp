// SPDX-License-Identifier: GPL-3.0-or-later
// The thread of the links of a Board or a Fleet, and the calls that wait for it.
//     a thread of the program           the loop's thread
//     run(call) ---- posted ---->       begin(): each board starts its part, with the time left
//        waits  <--- end() ------       each part ends
//
// A caller gives up at its deadline, or when on_wait() throws. Then a call that has not begun never
// begins, and a begun call is cancelled. After a sleep of this computer, a call whose time is over
// does not begin. A stop is sent, however late.
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
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "../measurement/time.hpp"
#include "r4link/async_board.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/control/boot_clock.hpp"
#include "r4link/error.hpp"

namespace r4 {

class BlockingLoop {
 public:
  using Clock = std::chrono::steady_clock;
  using Duration = std::chrono::milliseconds;
  static constexpr Duration wait_interval{50};

  struct Call;
  using CallPtr = std::shared_ptr<Call>;
  // Ends a part of a call, on the loop.
  struct End {
    void operator()(const CommandResult& result) const { loop->end(*call, part, result); }
    BlockingLoop* loop;
    CallPtr call;
    std::size_t part;
  };
  using BoundEnd = asio::cancellation_slot_binder<End, asio::cancellation_slot>;
  // Begins a board's part, on the loop, with the remaining time.
  using Start =
      std::function<void(AsyncBoard& board, std::size_t part, Duration left, BoundEnd end)>;
  struct Part {
    AsyncBoard* board = nullptr;
    CommandResult result{};
    LinkStatus link{};                 // at the end
    std::optional<Problem> trouble{};  // why the part could not begin: the role has changed
    asio::cancellation_signal cancelled{};
  };
  // Owned by both threads, because the caller may give up.
  struct Call {
    Call(std::string what, Start begin, const std::vector<AsyncBoard*>& boards, bool is_stop)
        : text(std::move(what)), start(std::move(begin)), stop(is_stop), left(boards.size()) {
      for (AsyncBoard* board : boards) parts.emplace_back().board = board;
    }
    const std::string text;  // names the call in errors
    const Start start;
    const bool stop;
    std::deque<Part> parts;
    std::size_t left;  // parts that have not ended
    bool begun = false;
    bool abandoned = false;
    std::condition_variable ended;
    const BootClock::time_point called = BootClock::now();
  };
  static Start start_of(CommandOrGroup what);

  // For errors: "board" or "fleet", and the fix if the thread does not answer.
  struct Name {
    std::string_view thing;
    std::string_view fix;
  };

  BlockingLoop(Name name, int concurrency, std::function<void()> wait)
      : on_wait(std::move(wait)), io(concurrency), name_(name) {}
  BlockingLoop(const BlockingLoop&) = delete;
  BlockingLoop& operator=(const BlockingLoop&) = delete;

  // Waits until all parts have ended. Throws Error if late or closed, and exceptions of on_wait().
  void run(const CallPtr& call, Duration timeout);
  // Begins the call with Board::default_timeout, and does not wait. No effect if closed.
  void run_unawaited(const CallPtr& call);
  // Does not wait. False if the loop is closed.
  bool post_to_loop(std::function<void()> action);
  // Waits until `action` has ended. False if the loop is closed. If `action` does not begin in
  // time, throws Error, and `action` never runs. Passes on exceptions of `action`.
  bool run_on_loop(std::string_view what, const std::function<void()>& action);
  // False at the deadline, or after a longer sleep, which stops the deadline's clock. If the loop
  // is closed, throws an error about `what()`. what() and arrived() run under the lock.
  template <class What, class Predicate>
  bool wait_for_news(What what, Duration timeout, Predicate arrived) {
    const SleepWatch slept;
    std::unique_lock lock(mutex);
    const bool woken = wait_until(lock, news, Clock::now() + bounded(timeout), on_wait,
                                  [&] { return closed || arrived(); });
    if (closed) throw closed_error(what());
    return woken && slept.time() <= bounded(timeout);
  }
  // Waits until done() is true; false at the deadline. done() runs under the lock. Calls
  // while_waiting() every 50 ms without the lock, and passes on its exceptions.
  template <class Predicate>
  static bool wait_until(std::unique_lock<std::mutex>& lock, std::condition_variable& changed,
                         Clock::time_point deadline, const std::function<void()>& while_waiting,
                         Predicate done) {
    if (!while_waiting) return changed.wait_until(lock, deadline, done);
    while (!changed.wait_until(lock, std::min(deadline, Clock::now() + wait_interval), done)) {
      if (Clock::now() >= deadline) return false;
      lock.unlock();
      while_waiting();
      lock.lock();
    }
    return true;
  }

  template <class Value>
  Value read(const Value& value) {
    const std::lock_guard lock(mutex);
    return value;
  }
  Error closed_error(std::string_view what) const;

  // Throws std::system_error if the system has no thread left.
  void start(std::function<void()> loop) { thread_ = std::thread(std::move(loop)); }
  // Closes the boards on the loop, ends the loop, and joins the thread. Idempotent.
  void close(const std::vector<AsyncBoard*>& boards);

  const std::function<void()> on_wait;
  asio::io_context io;
  // Used by both threads.
  std::mutex mutex;
  std::condition_variable news;  // `closed` or the condition of wait_for_news() has changed
  bool closed = false;

 protected:
  ~BlockingLoop() = default;
  // Called under the lock: a part has ended; the loop accepts nothing from now on.
  virtual void on_end() {}
  virtual void on_close() {}

 private:
  // The longest wait of close() for the boards' reports that they are free.
  static constexpr Duration farewell_limit{100};
  void shut(const std::vector<AsyncBoard*>& boards);
  void begin(const CallPtr& call, Duration timeout);
  void end(Call& call, std::size_t part, const CommandResult& result);
  Error blocked_error(std::string_view what, std::string_view instead, std::string_view fix) const;

  const Name name_;
  asio::executor_work_guard<asio::io_context::executor_type> work_{io.get_executor()};
  std::thread thread_;
  std::size_t leaving_ = 0;  // boards that close() waits for
  std::mutex joining_;
};

}  // namespace r4
