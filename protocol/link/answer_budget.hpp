// SPDX-License-Identifier: GPL-3.0-or-later
// Limits long answers to unproven peers: 50 a second on average, and 16 at once. The source of a
// datagram may be forged, and the board must not flood another device. Times are ms, and wrap.
#pragma once

#include <cstdint>

namespace r4 {

class AnswerBudget {
 public:
  static constexpr std::uint32_t spacing_ms = 20;
  static constexpr std::uint32_t burst = 16;

  bool take(std::uint32_t now_ms) {
    std::uint32_t debt_ms = whole_ms_ - now_ms;
    if (debt_ms > burst * spacing_ms) debt_ms = 0;  // the budget has long been full
    if (debt_ms + spacing_ms > burst * spacing_ms) return false;
    whole_ms_ = now_ms + debt_ms + spacing_ms;
    return true;
  }

 private:
  std::uint32_t whole_ms_ = 0;  // when the whole budget is available again
};

}  // namespace r4
