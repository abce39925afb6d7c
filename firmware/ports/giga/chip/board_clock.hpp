// SPDX-License-Identifier: GPL-3.0-or-later
// The board's time. Microseconds are the core's free-running timer; they go on in interrupts and in
// fault handlers and wrap after 71 minutes. Milliseconds are carried on by the timer interrupt, from
// the same timer, so that a late interrupt loses none; they wrap after 49 days.
#pragma once

#include <cstdint>

namespace r4 {
namespace giga {

class BoardClock {
 public:
  // `first_ms`: what it shows now. Another for each boot, so that no T of one is a T of another.
  static void start(std::uint32_t first_ms);
  // In the timer interrupt; more often than the microseconds wrap.
  static void advance();

  static std::uint32_t now_us();
  static std::uint32_t now_ms();
};

}  // namespace giga
}  // namespace r4
