// SPDX-License-Identifier: GPL-3.0-or-later
// The board's state as the host has it, with the time at which it came.
//
// Fields that a datagram does not carry keep their value, as State says, within one boot of the board:
// with a restart everything is forgotten. `safe` is also kept up to date by heartbeats, which go on when
// states do not; everything else is as old as age() says, however well it looks.
#pragma once

#include <chrono>

#include "../../protocol/messages/state.hpp"

namespace r4 {

struct ReceivedState : State {
  using Clock = std::chrono::steady_clock;

  // When its newest datagram came.
  Clock::time_point received = never;
  // Clock::time_point::min() while none has come since the board began.
  static constexpr Clock::time_point never = Clock::time_point::min();
  bool any() const { return received != never; }
  // How long ago that was; Clock::duration::max() while none has come.
  Clock::duration age(Clock::time_point now = Clock::now()) const {
    return any() ? now - received : Clock::duration::max();
  }
};

}  // namespace r4
