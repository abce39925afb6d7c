// SPDX-License-Identifier: GPL-3.0-or-later
// Whether the board executes a group together: the capability `group` in its answer to Q:ID.
//               I:… with `group`
//     unknown ----------------------> together
//      ^   |                             ^
//      |   |  I:… without it, or a board that never answers
//      |   +---------------------------> apart
//      |                                 |
//      +---- the board has restarted ----+
//
//     unknown   while a group waits, Q:ID is sent every 100 ms. A bad path may lose many Q:ID, but
//               the board must not execute the commands one by one. So a board that has ever
//               answered gets Q:ID until it answers again
//     together  a group is one datagram
//     apart     the commands of a group are sent one after the other. A late answer also counts
#pragma once

#include <cstdint>

#include "../../protocol/messages/command_group.hpp"
#include "../../protocol/messages/message.hpp"
#include "r4link/link.hpp"

namespace r4 {

class GroupSupport {
 public:
  enum class State : std::uint8_t { unknown, together, apart };

  State state() const { return state_; }

  void on_identity(Text capabilities) {
    state_ = has_capability(capabilities, group_capability) ? State::together : State::apart;
  }
  void on_restart() {
    state_ = State::unknown;
    unanswered_ = 0;
  }
  // True if Q:ID is due. Call ask() while a group waits. `answers`: the board has ever answered.
  bool ask(bool answers, Time now) {
    if (state_ != State::unknown || now < next_) return false;
    next_ = now + retry;
    unanswered_ += unanswered_ <= most_unanswered ? 1 : 0;
    if (answers || unanswered_ <= most_unanswered) return true;
    state_ = State::apart;
    return false;
  }
  Time next() const { return next_; }

 private:
  static constexpr Time retry = std::chrono::milliseconds{100};
  static constexpr int most_unanswered = 5;

  State state_ = State::unknown;
  int unanswered_ = 0;
  Time next_{0};
};

}  // namespace r4
