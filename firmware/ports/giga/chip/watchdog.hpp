// SPDX-License-Identifier: GPL-3.0-or-later
// Independent watchdog IWDG1 (RM0399, chapter IWDG). Cannot be stopped; resets the chip limit_ms
// after the last feed(). Its own clock is 32 kHz within 7 %.
#pragma once

#include <cstdint>

#include "chip.hpp"

namespace r4 {
namespace giga {

class Watchdog {
 public:
  static constexpr std::uint32_t limit_ms = 500;

  static void start() {
    constexpr std::uint32_t clock_hz = 32000;
    constexpr std::uint32_t divider = 16;
    constexpr std::uint32_t divide_by_16 = 2;
    IWDG1->KR = 0xCCCC;  // start
    IWDG1->KR = 0x5555;  // unlocks the next two registers
    IWDG1->PR = divide_by_16;
    IWDG1->RLR = clock_hz / divider * limit_ms / 1000;
    feed();
  }
  static void feed() { IWDG1->KR = 0xAAAA; }
};

}  // namespace giga
}  // namespace r4
