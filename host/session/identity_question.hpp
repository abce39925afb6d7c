// SPDX-License-Identifier: GPL-3.0-or-later
// Q:ID, asked now and then for the round-trip time, and by whoever wants to know: without I/O.
//
//     idle --asked--> open --I:…--> idle: the round trip is known
//                      |  ^
//                      +--+ asked again: the answer counts from the newest
#pragma once

#include <cstdint>
#include <optional>

#include "time.hpp"

namespace r4 {

class IdentityQuestion {
 public:
  // `interval`: from one question of ours to the next; 0: none is asked.
  explicit IdentityQuestion(Time interval) : interval_(interval) {}

  bool due(Time now) const { return interval_.count() != 0 && now >= next_; }
  // When due() may be true next; Time::max() for never.
  Time next() const { return interval_.count() != 0 ? next_ : Time::max(); }
  // One of ours goes out.
  void ask(Time now) {
    next_ = now + interval_;
    asked(now);
  }
  // One goes out, whoever asked.
  void asked(Time now) {
    state_ = State::open;
    sent_ = now;
  }
  // The board has answered: the time since it was asked; none if it was not.
  std::optional<Time> answered(Time now) {
    if (state_ == State::idle) return {};
    state_ = State::idle;
    return now - sent_;
  }

 private:
  enum class State : std::uint8_t { idle, open };
  Time interval_;
  State state_ = State::idle;
  Time next_{0};
  Time sent_{0};
};

}  // namespace r4
