// SPDX-License-Identifier: GPL-3.0-or-later
// What is behind a Board: the thread of its link, that of its callbacks, and the calls that wait.
//
//     a thread of the program       the link's thread            the callbacks' thread
//     send() -- Call, post() -->    AsyncBoard on its loop  -->  callback_thread.hpp
//            <-- ended, news --
//
// The link's thread waits for nobody: nothing of the program runs there but a transport of its own. The
// threads meet under `mutex`.
#pragma once

#include <algorithm>
#include <asio/bind_cancellation_slot.hpp>
#include <asio/cancellation_signal.hpp>
#include <asio/executor_work_guard.hpp>
#include <asio/io_context.hpp>
#include <asio/steady_timer.hpp>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "board_loop.hpp"
#include "callback_thread.hpp"
#include "measurement/boot_clock.hpp"
#include "post_box.hpp"
#include "r4link/async_board.hpp"
#include "r4link/board.hpp"
#include "state_queue.hpp"
#include "uart/uart_stream.hpp"

namespace r4 {

struct Board::Impl : std::enable_shared_from_this<Board::Impl> {
  using Clock = std::chrono::steady_clock;
  static constexpr Duration wait_interval{50};

  // Something asked of the loop, and its answer. Held by both sides, since the caller may give up:
  // what the loop has not begun by then, it leaves alone.
  struct Call {
    explicit Call(const Command& c);
    Command command;
    std::string text, text2;
    const Clock::time_point called = Clock::now();
    // For what is not one command: has the loop begin it, with the time that is left.
    using End = asio::cancellation_slot_binder<std::function<void(const CommandResult&)>,
                                               asio::cancellation_slot>;
    std::function<void(Duration left, End end)> start;
    asio::cancellation_signal cancelled;
    bool begun = false;
    bool abandoned = false;
    bool done = false;
    std::condition_variable ended;
    CommandResult result;
    LinkStatus link;
    BoardIdentity identity;
  };
  using CallPtr = std::shared_ptr<Call>;

  using CarriersMaker = std::function<std::vector<std::unique_ptr<Carrier>>(Loop& loop)>;
  Impl(const CarriersMaker& make, BoardOptions options, BoardCallbacks first);
  // One whose threads run. Throws Error, also where the system has no thread or descriptor left.
  static std::shared_ptr<Impl> started(const CarriersMaker& make, BoardOptions options,
                                       BoardCallbacks first);
  void start();
  // Idempotent, from any thread.
  void close();

  // --- on any thread

  void require_sendable(const Command& command);
  // Has the loop carry out a command. Throws if it is not confirmed.
  CallPtr execute(const Command& command, Duration timeout);
  CallPtr execute(const std::string& text, CallPtr call, Duration timeout);
  // The same, and leaves what became of it to the caller; throws if that is not known, or the board is closed.
  void run(const std::string& text, const CallPtr& call, Duration timeout);
  PostResult post(const Command& command);
  PostResult post(const Setpoints& setpoints);
  bool is_held_back();
  // Does `action` on the loop and waits until it is done; nothing if the board is closed. Throws if
  // the loop does not begin in time; then it never will.
  void run_on_loop(std::string_view what, std::function<void()> action);
  // Waits until `arrived` (asked under the lock) is true. False if it was not in time. A sleep of
  // this computer is part of the time, though the deadline stands still meanwhile.
  template <class Predicate>
  bool wait_for_news(Duration timeout, Predicate arrived) {
    const SleepWatch slept;
    std::unique_lock lock(mutex);
    const bool woken = wait_until(lock, news, Clock::now() + bounded(timeout),
                                  [&] { return closed || arrived(); });
    if (closed) throw closed_error(name);
    return woken && slept.time() <= bounded(timeout);
  }
  // Waits for what `done` is asked under the lock; false at the deadline. Throws what on_wait() throws, without
  // the lock.
  template <class Predicate>
  bool wait_until(std::unique_lock<std::mutex>& lock, std::condition_variable& ended,
                  Clock::time_point deadline, Predicate done) {
    if (!on_wait) return ended.wait_until(lock, deadline, done);
    while (!ended.wait_until(lock, std::min(deadline, Clock::now() + wait_interval), done)) {
      if (Clock::now() >= deadline) return false;
      lock.unlock();
      on_wait();
      lock.lock();
    }
    return true;
  }
  // Under the lock.
  template <class Action>
  void for_each_queue(Action action) {
    std::erase_if(queues, [&](const std::weak_ptr<States::Queue>& each) {
      const std::shared_ptr<States::Queue> queue = each.lock();
      if (queue) action(*queue);
      return !queue;
    });
  }
  // Its caller does not wait for it any more.
  void abandon(const CallPtr& call);
  std::string name_now();
  LinkStatus link_now();
  std::uint64_t states_now();

  static Duration bounded(Duration timeout);
  static Error closed_error(std::string_view what);

  // A recording of this board's own, until another one takes its place.
  void keep(std::unique_ptr<Recording> own);

  // --- on the loop

  void listen();
  void take_name();
  void deliver(const Command& command);
  void deliver(const Setpoints& setpoints);
  void take_uarts(const State& fresh);
  void begin(const CallPtr& call, Clock::time_point deadline);
  void finish(Call& call, const CommandResult& result);
  void shut();
  void tell(CallbackThread::Notice notice);
  void look_at_callbacks();
  void on_callback_end(Clock::duration busy);

  const BoardRole role;
  const Arming arming;
  const Duration callback_limit;  // 0: none
  const std::function<void()> on_wait;
  asio::io_context io{1};
  asio::executor_work_guard<asio::io_context::executor_type> work{io.get_executor()};
  BoardLoop loop{io};
  AsyncBoard async;
  PostBox box;
  CallbackThread callbacks;
  std::thread thread;
  std::mutex joining;  // also of the recording
  std::unique_ptr<Recording> recording;

  // Of the loop.
  asio::steady_timer look_timer{io};
  bool held_for_callback = false;  // the heartbeats

  // What both sides see.
  std::mutex mutex;
  std::condition_variable news;  // state, link or closed has changed
  std::string name;              // the transport's, as the loop knows it
  std::vector<std::string> wire_names;
  ReceivedState state;
  std::uint64_t states = 0;
  std::vector<std::weak_ptr<States::Queue>> queues;
  // What has come in, for read() and for callbacks.
  struct UartInbox {
    UartStream stream;
    UartData to_read;
    UartData to_tell;
    bool told = false;  // there is a callback, or was one
  };
  UartInbox uarts[uart_channels];
  LinkStatus link;
  bool in_control = false;
  DisarmCause disarmed_by = DisarmCause::not_yet;
  std::uint64_t refused_here = 0;  // posts that did not get as far as the loop
  bool closed = false;
  Statistics last_statistics;
  CarrierCounters last_counters;
  std::vector<Wire> last_wires;
};

}  // namespace r4
