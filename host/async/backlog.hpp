// SPDX-License-Identifier: GPL-3.0-or-later
// Datagrams that arrived while the loop was delayed. Only the newest state of a backlog is
// reported. Datagrams from before a sleep of this computer are dropped.
//     live --the loop was delayed------> in backlog --the transport is drained--> live
//     any  --sleep----> waking     --drained, or the timer expired twice--> live
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

#include "r4link/datagram.hpp"

namespace r4 {

class Backlog {
 public:
  void on_held_up() { behind_ = true; }
  void on_sleep() {
    waking_ = 2;
    forget();
  }
  void forget() { size_ = 0; }

  bool drops() const { return waking_ != 0; }
  bool keeps_states() const { return behind_; }
  void keep(Text state) {
    size_ = state.size();
    std::copy_n(state.data(), size_, state_.data());
  }

  void on_drained() {
    behind_ = false;
    waking_ = 0;
    rings_ = 0;
  }
  // True if the kept state must be reported, because some transports never call on_drained().
  bool on_timer() {
    if (waking_ != 0) --waking_;
    rings_ = size_ == 0 ? 0 : rings_ + 1;
    return rings_ >= 2;
  }
  // Removes and returns the kept state; empty if no state is kept. Valid until the next keep().
  Text take() { return {state_.data(), std::exchange(size_, 0)}; }

 private:
  bool behind_ = false;
  int waking_ = 0;  // timer expiries until no datagram from before a sleep can arrive
  int rings_ = 0;   // timer expiries while a state is kept
  std::array<char, max_datagram> state_;
  std::size_t size_ = 0;
};

}  // namespace r4
