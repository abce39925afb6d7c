// SPDX-License-Identifier: GPL-3.0-or-later
// The datagrams that came while a program stood still: of the states in a backlog only the newest
// is reported. Datagrams from before a sleep of this computer are dropped.
//     live --the program stands still--> in backlog --the transport is drained--> live
//     any  --sleep----> waking     --drained, or the timer rang twice--> live
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
  // The kept state is of an earlier boot of the board, or from before a sleep.
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
  // The timer rang. True if the kept state is to be reported: twice without on_drained(), so the
  // transport may be one that never says that it is drained.
  bool on_timer() {
    if (waking_ != 0) --waking_;
    rings_ = size_ == 0 ? 0 : rings_ + 1;
    return rings_ >= 2;
  }
  // Takes the kept state; empty if there is none. Valid until the next keep().
  Text take() { return {state_.data(), std::exchange(size_, 0)}; }

 private:
  bool behind_ = false;
  int waking_ = 0;  // times that the timer may ring until nothing from before a sleep can come
  int rings_ = 0;   // times that the timer has rung while a state was kept
  std::array<char, max_datagram> state_;
  std::size_t size_ = 0;
};

}  // namespace r4
