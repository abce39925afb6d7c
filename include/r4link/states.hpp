// SPDX-License-Identifier: GPL-3.0-or-later
// The states of a board, one after the other, for a loop of the program's own:
//
//     r4::States states = board.states({.lossless = true});
//     while (const auto state = states.take(1s)) …
//
// Callbacks are told of the newest state where several have come meanwhile. Here the link's thread leaves each, one
// for each datagram, whatever callbacks do. AsyncBoard::on_state() is called for each anyway.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>

#include "config.hpp"
#include "link.hpp"

namespace r4 {

// What becomes of states that come faster than they are taken.
struct StatesOptions {
  // None is lost: where no more can wait, take() throws behind the last one that could. Otherwise the oldest gives way.
  bool lossless = false;
  // So many wait, of some 400 bytes each. 0: the newest alone or, of those of which none is lost, 65536: eleven minutes
  // at 100 Hz.
  std::size_t most = 0;
};

// From Board::states(). May be moved; may outlive its board. One thread takes.
class R4LINK_API States {
 public:
  using Duration = std::chrono::milliseconds;

  // The next one; waits for it. Nothing if none came in time, or the board was closed and what waited has been
  // taken. Throws Error{data} where states were lost of which none should be, once for each such gap, and goes on behind
  // it.
  std::optional<ReceivedState> take(Duration timeout);
  // None will come any more, and none waits.
  bool ended() const;
  // Those that were not taken, and gave way or found no room.
  std::uint64_t missed() const;

  class R4LINK_PRIVATE Queue;

 private:
  friend class Board;
  explicit States(std::shared_ptr<Queue> queue) : queue_(std::move(queue)) {}
  std::shared_ptr<Queue> queue_;
};

}  // namespace r4
