// SPDX-License-Identifier: GPL-3.0-or-later
// Does the board execute a group of commands together (capability `group` of its answer to Q:ID)? Without
// I/O, part of a session.
//
//               I:… with the word
//     unknown ----------------------> together
//      ^   |                             ^
//      |   |  I:… without it, or a board that answers nothing at all
//      |   +---------------------------> apart
//      |                                 |
//      +---- the board has begun again --+
//
//     unknown   a group waits, and Q:ID is sent every 100 ms. On a bad line many may be lost: a board that
//               has ever answered anything is asked until it does, or what is to be done together would be
//               done one by one
//     together  a group is one datagram
//     apart     its commands are sent one after the other. An answer that comes late counts all the same
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
  // A group waits: is Q:ID to be sent now? `answers`: the board has ever answered anything. One that does
  // not (the paper's release) will not answer this either.
  bool ask(bool answers, Time now) {
    if (state_ != State::unknown || now < next_) return false;
    next_ = now + retry;
    unanswered_ += unanswered_ <= most_unanswered ? 1 : 0;
    if (answers || unanswered_ <= most_unanswered) return true;
    state_ = State::apart;
    return false;
  }
  // When ask() may be true next, while a group waits and it is unknown.
  Time next() const { return next_; }

 private:
  static constexpr Time retry = std::chrono::milliseconds{100};
  static constexpr int most_unanswered = 5;

  State state_ = State::unknown;
  int unanswered_ = 0;
  Time next_{0};
};

}  // namespace r4
