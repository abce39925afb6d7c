// SPDX-License-Identifier: GPL-3.0-or-later
// What is behind a Fleet: its boards on one loop, the thread of that, and the calls that wait.
//
//     a thread of the program          the links' thread
//     send(), post() -- a Call -->     every AsyncBoard in turn, in one pass
//            <-- results --            each board's end
//     next_event()   <-- events, 4096 at most --
//
// Nothing of the program runs on the loop. The threads meet under `mutex`.
#pragma once

#include <algorithm>
#include <asio/bind_cancellation_slot.hpp>
#include <asio/cancellation_signal.hpp>
#include <asio/executor_work_guard.hpp>
#include <asio/io_context.hpp>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "r4link/async_board.hpp"
#include "r4link/fleet.hpp"

namespace r4 {

struct Fleet::Impl {
  using Clock = std::chrono::steady_clock;
  static constexpr std::size_t most_events = 4096;

  // Something asked of boards, and what became of it. Held by both sides, since the caller may give up: what the
  // loop has not begun by then, it leaves alone.
  struct Call;
  using CallPtr = std::shared_ptr<Call>;
  // How a board's part ends. Cancelled with the call.
  struct End {
    Impl* impl;
    CallPtr call;
    std::size_t at;
    void operator()(const CommandResult& result) const { impl->finish(*call, at, result); }
  };
  using BoundEnd = asio::cancellation_slot_binder<End, asio::cancellation_slot>;
  // Has a board begin it, with the time that is left; `at`: its place in Call::boards.
  using Start = std::function<void(std::size_t board, std::size_t at, Duration left, BoundEnd end)>;
  struct Call {
    std::string text;  // of an error
    Boards boards;
    Start start;
    bool stop = false;  // goes out however late it is
    std::deque<asio::cancellation_signal> cancelled;
    std::vector<FleetResult> results;
    std::size_t left = 0;  // boards whose part has not ended
    bool begun = false;
    bool abandoned = false;
    std::condition_variable ended;
  };

  Impl(const std::vector<std::string>& patterns, BoardOptions options);
  ~Impl() { close(); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  // Idempotent, from any thread.
  void close();

  // --- on any thread

  // Has the boards carry it out, and waits for the ends of all.
  FleetResults execute(std::string text, const Boards& which, Duration timeout, Start start,
                       bool stop = false);
  // Does `action` on the loop, between other things, and waits until it is done. Throws if the loop does not begin
  // it in time (then it never will), or if the fleet is closed; and what `action` throws.
  void run_on_loop(std::string_view what, const std::function<void()>& action);
  Boards wait_active(const Boards& which, Duration timeout);
  std::optional<FleetEvent> next_event(Duration timeout);
  BoardHealth health_of(std::size_t board) const;  // on the loop
  FleetResults stop(const Boards& which, Duration timeout);
  void stop_async() { stop_async(all_boards, start_of_stop()); }
  void stop_async(const Boards& which, Start start);
  void require_board(std::size_t board) const;

  // --- on the loop

  void run();
  void listen(std::size_t board);
  void tell(FleetEvent event);
  CallPtr call_of(std::string text, const Boards& which, Start start) const;
  Start start_of_stop();
  void begin(const CallPtr& call, Clock::time_point deadline);
  void finish(Call& call, std::size_t at, const CommandResult& result);
  void shut();

  // Waits for what `done` is asked under the lock; false at the deadline. Throws what on_wait() throws, without the
  // lock.
  template <class Predicate>
  bool wait_until(std::unique_lock<std::mutex>& lock, std::condition_variable& ended,
                  Clock::time_point deadline, Predicate done) {
    constexpr Duration interval{50};
    if (!on_wait) return ended.wait_until(lock, deadline, done);
    while (!ended.wait_until(lock, std::min(deadline, Clock::now() + interval), done)) {
      if (Clock::now() >= deadline) return false;
      lock.unlock();
      on_wait();
      lock.lock();
    }
    return true;
  }

  const BoardRole role;
  const std::function<void()> on_wait;
  std::vector<std::string> urls;
  Boards all_boards;
  // Other threads do nothing on it but post: what the reactor does needs no locks.
  asio::io_context io{ASIO_CONCURRENCY_HINT_UNSAFE_IO};
  asio::executor_work_guard<asio::io_context::executor_type> work{io.get_executor()};
  std::vector<std::unique_ptr<AsyncBoard>> boards;
  std::size_t leaving = 0;  // boards that say farewell
  std::thread thread;
  std::mutex joining;

  // What both sides see.
  std::mutex mutex;
  std::condition_variable news;   // of `links`, `events` and `closed`
  std::vector<LinkStatus> links;  // of each board
  std::deque<FleetEvent> events;
  std::uint64_t missed_events = 0;
  bool opened = false;
  bool closed = false;
};

}  // namespace r4
