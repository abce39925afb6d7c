// SPDX-License-Identifier: GPL-3.0-or-later
// The core's timer counts the microseconds, which wrap after 71 minutes. Interrupts and fault
// handlers may read them. The timer interrupt counts the milliseconds, which wrap after 49 days.
#pragma once

#include <cstdint>

namespace r4 {
namespace giga {

class BoardClock {
 public:
  // Starts at `first_ms`: random, so that times of two boots differ.
  static void start(std::uint32_t first_ms);
  // Call in the timer interrupt, before the microseconds wrap.
  static void advance();

  static std::uint32_t now_us();
  static std::uint32_t now_ms();
};

}  // namespace giga
}  // namespace r4
