// SPDX-License-Identifier: GPL-3.0-or-later
// The implementation of a Fleet: its boards on one loop, the loop's thread, and calls that wait.
//     a thread of the program          the links' thread
//     send(), post() -- a Call -->     every AsyncBoard in turn, in one pass
//            <-- results --            the end of each board's part
//     next_event()   <-- events, 4096 at most --
//
// No code of the program runs on the loop (blocking_loop.hpp).
#pragma once

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

struct Fleet::Impl final : BlockingLoop {
  static constexpr std::size_t most_events = 4096;

  Impl(const std::vector<std::string>& patterns, BoardOptions options);
  ~Impl() { close(); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  // Idempotent, from any thread.
  void close();

  // --- on any thread

  // explain() for the part of a board that was not confirmed.
  using Why =
      std::function<Problem(std::size_t part, const CommandResult& result, const LinkStatus& link)>;
  FleetResults execute(std::string text, const Boards& which, Duration timeout, Start start,
                       const Why& why, bool stop = false);
  // Also throws if the fleet is closed.
  void run_on_loop(std::string_view what, const std::function<void()>& action);
  Boards wait_active(const Boards& which, Duration timeout);
  std::optional<FleetEvent> next_event(Duration timeout);
  BoardHealth health_of(std::size_t board) const;  // on the loop
  FleetResults stop(const Boards& which, Duration timeout);
  void stop_async(const Boards& which);
  void require_board(std::size_t board) const;
  CallPtr call_of(std::string text, const Boards& which, Start start, bool stop);

  // --- on the loop

  void run();
  void listen(std::size_t board);
  void notify(FleetEvent event);

  const BoardRole role;
  std::vector<std::string> urls;
  Boards all_boards;
  std::vector<std::unique_ptr<AsyncBoard>> boards;

  // Shared by all threads, under the lock.
  std::vector<LinkStatus> links;
  std::deque<FleetEvent> events;
  std::uint64_t missed_events = 0;
};

template <class What>
auto why_of(const What& what) {
  return [&what](std::size_t, const CommandResult& result, const LinkStatus& link) {
    return explain(what, result, link);
  };
}

}  // namespace r4
