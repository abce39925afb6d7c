// SPDX-License-Identifier: GPL-3.0-or-later
// How many long answers go to peers that have proved nothing: 50 a second in the long run, and 16 at
// once. Where a datagram says that it comes from may be forged, and nobody is to be flooded in that
// way. Answers of about the size of what they answer need no budget.
//
// All times are in ms, and wrap.
#pragma once

#include <cstdint>

namespace r4 {

class AnswerBudget {
 public:
  static constexpr std::uint32_t spacing_ms = 20;
  static constexpr std::uint32_t burst = 16;

  // True if one more answer may go out now.
  bool take(std::uint32_t now_ms) {
    std::uint32_t debt_ms = whole_ms_ - now_ms;
    if (debt_ms > burst * spacing_ms) debt_ms = 0;  // it has been whole for a while
    if (debt_ms + spacing_ms > burst * spacing_ms) return false;
    whole_ms_ = now_ms + debt_ms + spacing_ms;
    return true;
  }

 private:
  std::uint32_t whole_ms_ = 0;  // when all of it may be used again
};

}  // namespace r4
