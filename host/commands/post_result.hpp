// SPDX-License-Identifier: GPL-3.0-or-later
// What became of a command that is sent once and not waited for. True where it was sent:
//
//     if (!board.post(setpoint)) …        if (board.post(setpoint) == PostResult::not_armed) …
#pragma once

#include <cstdint>

#include "../../protocol/messages/command.hpp"

namespace r4 {

class PostResult {
 public:
  enum Value : std::uint8_t {
    sent,
    not_armed,   // it drives an output, and the session is not armed (arming.hpp): call arm()
    no_link,     // the link is not up, or the board does not take our commands yet
    queue_full,  // too many wait to be sent already: try again later
  };
  PostResult(Value value) : value_(value) {}        // NOLINT(google-explicit-constructor)
  operator bool() const { return value_ == sent; }  // NOLINT(google-explicit-constructor)
  Value value() const { return value_; }            // for a switch
  friend bool operator==(PostResult a, PostResult b) { return a.value_ == b.value_; }
  friend bool operator==(PostResult a, Value b) { return a.value_ == b; }

 private:
  Value value_;
};

// "sent", "not armed", "no link", "queue full".
const char* to_text(PostResult result);

// A command that post() took and that was not executed.
struct RefusedPost {
  Command command;               // without its texts
  Refusal code = Refusal::none;  // of the board; none where it did not get there: `why`
  PostResult why = PostResult::sent;
};

}  // namespace r4
