// SPDX-License-Identifier: GPL-3.0-or-later
// Q:ID, asked now and then for the round-trip time, and by whoever wants to know: without I/O. The newest
// eight questions are remembered, each of them one such machine:
//
//     idle --asked--> open --I:… names it--> idle: the round trip is known
//                      |
//                      +-- eight newer ones --> forgotten
//
// The answer names its question (ASKED). Of a board that does not it counts from the newest question, which
// is good for a round trip, and not for more.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "../../protocol/messages/message.hpp"
#include "r4link/link.hpp"

namespace r4 {

class IdentityQuestion {
 public:
  // `interval`: from one question of ours to the next; 0: none is asked.
  explicit IdentityQuestion(Time interval) : interval_(interval) {}

  // Is one due: `interval` after the last of ours, or `sooner` after the newest of anyone, whichever is
  // earlier?
  bool due(Time sooner, Time now) const { return now >= next(sooner); }
  // When due() may be true next; Time::max() for never.
  Time next(Time sooner) const {
    if (interval_.count() == 0) return Time::max();
    return std::min(next_, newest_ + sooner);
  }
  // One of ours goes out.
  void ask(std::uint32_t pnum, Time now) {
    next_ = now + interval_;
    asked(pnum, now);
  }
  // One goes out, whoever asked.
  void asked(std::uint32_t pnum, Time now) {
    newest_ = now;
    // What is sent again may be answered as it was sent first.
    const auto same = [pnum](const Asked& each) { return each.open && each.pnum == pnum; };
    if (std::any_of(open_.begin(), open_.end(), same)) return;
    open_[count_++ % open_.size()] = {pnum, now, true};
  }
  // The board has answered: when it was asked, first; none if it was not.
  std::optional<Time> answered(const Identity& identity) {
    for (std::size_t i = 1; i <= open_.size(); ++i) {  // from the newest
      Asked& asked = open_[(count_ - i) % open_.size()];
      if (!asked.open || (identity.has_asked && identity.asked != asked.pnum)) continue;
      const Time at = asked.at;
      asked.open = false;
      if (!identity.has_asked) open_ = {};
      return at;
    }
    return {};
  }

 private:
  struct Asked {
    std::uint32_t pnum = 0;
    Time at{0};
    bool open = false;
  };
  Time interval_;
  Time next_{0};
  Time newest_{0};
  std::array<Asked, 8> open_{};
  std::size_t count_ = 0;
};

}  // namespace r4
