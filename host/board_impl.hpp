// SPDX-License-Identifier: GPL-3.0-or-later
// The implementation of a Board: the link's thread, the callbacks' thread, and waiting calls.
//     a thread of the program       the link's thread            the callbacks' thread
//     send() -- Call, post() -->    AsyncBoard on its loop  -->  callback_thread.hpp
//            <-- ended, news --
//
// The link's thread (blocking_loop.hpp) does not wait. Of the program's code, it runs only the
// program's own transport and functions of post_to_loop().
#pragma once

#include <array>
#include <asio/steady_timer.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "blocking/blocking_loop.hpp"
#include "board_loop.hpp"
#include "callback_thread.hpp"
#include "post_box.hpp"
#include "r4link/async_board.hpp"
#include "r4link/board.hpp"
#include "state_queue.hpp"
#include "uart/uart_stream.hpp"

namespace r4 {

// More than 15 members, grouped by the thread that may touch them.
struct Board::Impl final : BlockingLoop {
  using CarriersMaker = std::function<std::vector<std::unique_ptr<Carrier>>(Loop& loop)>;
  Impl(const CarriersMaker& make, BoardOptions options, BoardCallbacks first);
  // Starts the threads. Throws Error, also if the system has no thread or descriptor.
  static std::shared_ptr<Impl> started(const CarriersMaker& make, BoardOptions options,
                                       BoardCallbacks first);
  // Idempotent, from any thread.
  void close();

  // --- on any thread

  void require_sendable(const CommandOrGroup& what);
  // Throws Error unless the board confirms it.
  void execute(const CommandOrGroup& what, Duration timeout);
  // Executes a command, a group or the named request, and returns any outcome. Throws Error if it
  // is unknown or the board is closed.
  std::shared_ptr<const Part> run(const std::string& text, Start start, Duration timeout,
                                  bool stop = false);
  PostResult post(const CommandOrGroup& what);
  template <class Predicate>
  bool wait_for_news(Duration timeout, Predicate arrived) {
    return BlockingLoop::wait_for_news([this] { return name; }, timeout, std::move(arrived));
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
  // Returns the result of `ask` on the loop. If the board is closed: `last`.
  template <class Report, class Ask>
  Report report(std::string_view what, const Report& last, Ask ask) {
    Report now;
    return run_on_loop(what, [&] { now = ask(); }) ? now : read(last);
  }

  void keep(std::unique_ptr<Recording> own);

  // --- on the loop

  void listen();
  void take_name();
  void deliver(const CommandOrGroup& what, bool late);
  void take_uarts(const State& fresh);
  void on_end() override { identity = async.identity(); }
  void on_close() override;
  void look_at_callbacks();
  void on_callback_end(Clock::duration busy);

  const Arming arming;
  const Duration callback_limit;  // 0: no limit
  BoardLoop loop{io};
  AsyncBoard async;
  PostBox box;
  CallbackThread callbacks;

  // Used on the loop only.
  asio::steady_timer look_timer{io};
  bool held_for_callback = false;

  // Shared by all threads, under the lock. A change of the state or the link notifies `news`.
  std::string name;                    // the transports' names
  std::vector<PathStatus> last_paths;  // of the last event of a transport, or of the end
  ReceivedState state;
  std::uint64_t states = 0;
  std::vector<std::weak_ptr<States::Queue>> queues;
  struct UartInbox {
    UartStream stream;
    UartData to_read;
    UartData to_report;
    bool reports = false;  // has callbacks
  };
  UartInbox uarts[uart_channels];
  LinkStatus link;
  BoardIdentity identity;
  DisarmCause disarmed_by = DisarmCause::not_yet;
  std::uint64_t refused_here = 0;  // posts that did not reach the loop
  std::array<std::optional<ServoCalibration>, servo_channels> servo_calibrations;
  Statistics last_statistics;
  CarrierCounters last_counters;
  std::unique_ptr<Recording> recording;
};

// Throws Error unless the board has confirmed `what`.
template <class What, class Part>
Part confirmed(const What& what, Part part) {
  if (part->result.outcome == Outcome::confirmed) return part;
  throw Error(explain(what, part->result, part->link));
}

}  // namespace r4
