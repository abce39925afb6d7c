// SPDX-License-Identifier: GPL-3.0-or-later
// The newest eight questions Q:ID and their answers, without I/O. Each question is a state machine:
//     idle --asked--> open --I:… names it--> idle: the round trip is known
//                      |
//                      +-- eight newer ones --> forgotten
//
// An answer names its question (ASKED). Without ASKED the round trip counts from the newest
// question, and the answer closes all questions. An answer without ASKED may belong to an older
// question, so it does not limit the board's clock (board_clock.hpp).
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
  void asked(std::uint32_t pnum, Time now) {
    // Keeps the time of the first sending, because the board may have answered the first sending.
    const auto same = [pnum](const Asked& each) { return each.open && each.pnum == pnum; };
    if (std::any_of(open_.begin(), open_.end(), same)) return;
    open_[count_++ % open_.size()] = {pnum, now, true};
  }
  // Returns the time at which the answered question was first sent; no value if it is not open.
  std::optional<Time> answered(const Identity& identity) {
    for (std::size_t i = 1; i <= open_.size(); ++i) {
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
  std::array<Asked, 8> open_{};
  std::size_t count_ = 0;
};

}  // namespace r4
