// SPDX-License-Identifier: GPL-3.0-or-later
// What is behind a Fleet: its boards on one loop, the thread of that, and the calls that wait.
//
//     a thread of the program          the links' thread
//     send(), post() -- a Call -->     every AsyncBoard in turn, in one pass
//            <-- results --            each board's end
//     next_event()   <-- events, 4096 at most --
//
// Nothing of the program runs on the loop (blocking_loop.hpp).
#pragma once

#include <asio/bind_cancellation_slot.hpp>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "../blocking/blocking_loop.hpp"
#include "r4link/async_board.hpp"
#include "r4link/fleet.hpp"

namespace r4 {

struct Fleet::Impl : BlockingLoop {
  static constexpr std::size_t most_events = 4096;

  // Something asked of boards: one part each, and what became of it.
  struct Call final : BlockingLoop::Call {
    Boards boards;
    std::vector<FleetResult> results;
  };
  // How a board's part ends. Cancelled with the call.
  struct End {
    Impl* impl;
    std::shared_ptr<Call> call;
    std::size_t at;
    void operator()(const CommandResult& result) const { impl->finish(*call, at, result); }
  };
  using BoundEnd = asio::cancellation_slot_binder<End, asio::cancellation_slot>;
  // Has a board begin it, with the time that is left; `at`: its place in Call::boards.
  using Start = std::function<void(std::size_t board, std::size_t at, Duration left, BoundEnd end)>;

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
  // Throws if the fleet is closed, too.
  void run_on_loop(std::string_view what, const std::function<void()>& action);
  Boards wait_active(const Boards& which, Duration timeout);
  std::optional<FleetEvent> next_event(Duration timeout);
  BoardHealth health_of(std::size_t board) const;  // on the loop
  FleetResults stop(const Boards& which, Duration timeout);
  void stop_async(const Boards& which);
  void require_board(std::size_t board) const;

  // --- on the loop

  void run();
  void listen(std::size_t board);
  void tell(FleetEvent event);
  std::shared_ptr<Call> call_of(std::string text, const Boards& which, Start start, bool stop);
  Start start_of_stop();
  void finish(Call& call, std::size_t at, const CommandResult& result);
  void shut();

  const BoardRole role;
  std::vector<std::string> urls;
  Boards all_boards;
  std::vector<std::unique_ptr<AsyncBoard>> boards;
  std::size_t leaving = 0;  // boards that say farewell

  // What both sides see.
  std::vector<LinkStatus> links;  // of each board
  std::deque<FleetEvent> events;
  std::uint64_t missed_events = 0;
  bool opened = false;
};

}  // namespace r4
