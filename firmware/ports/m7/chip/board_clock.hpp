// SPDX-License-Identifier: GPL-3.0-or-later
// Timer 0 gives the time at 25 MHz; timer 1 wakes the loop each millisecond. SysTick cannot be used
// under QEMU: its interrupts are lost while QEMU's machine is busy.
#pragma once

#include <cstdint>

#include "registers.hpp"

namespace r4 {
namespace m7 {

class BoardClock {
 public:
  explicit BoardClock(std::uint32_t first_ms) : ms_(first_ms) {}

  void start() {
    at(timer0_base + value) = ~0U;
    at(timer0_base + reload) = ~0U;
    at(timer0_base + control) = on;
    last_ = at(timer0_base + value);
    wake_every(1000, 1000);
  }
  static void wake_every(std::uint32_t us, std::uint32_t first_us) {
    at(timer1_base + control) = 0;
    at(timer1_base + reload) = us * ticks_per_us - 1;
    at(timer1_base + value) = first_us * ticks_per_us - 1;
    on_wake_interrupt();
    at(timer1_base + control) = on | with_interrupt;
  }
  static void on_wake_interrupt() { at(timer1_base + interrupt) = 1; }

  // May be called in interrupts. Call more often than every 171 s, before the timer wraps.
  std::uint32_t now_ms() {
    const InterruptsHeld held;
    advance();
    return ms_;
  }
  std::uint32_t now_us() {  // wraps after 71 minutes
    const InterruptsHeld held;
    advance();
    return ms_ * 1000 + rest_ / ticks_per_us;
  }
  static std::uint32_t ticks() { return ~at(timer0_base + value); }  // counts up, wraps
  static constexpr std::uint32_t ticks_per_us = clock_hz / 1000000;

 private:
  // Registers of the CMSDK timer, which counts down.
  static constexpr std::uint32_t control = 0x0;
  static constexpr std::uint32_t value = 0x4;
  static constexpr std::uint32_t reload = 0x8;
  static constexpr std::uint32_t interrupt = 0xC;
  static constexpr std::uint32_t on = 1;  // bit of `control`
  static constexpr std::uint32_t with_interrupt = 8;

  static constexpr std::uint32_t ticks_per_ms = clock_hz / 1000;

  void advance() {
    const std::uint32_t now = at(timer0_base + value);
    const std::uint32_t passed = last_ - now;
    last_ = now;
    ms_ += passed / ticks_per_ms;
    rest_ += passed % ticks_per_ms;
    if (rest_ >= ticks_per_ms) {
      rest_ -= ticks_per_ms;
      ++ms_;
    }
  }

  std::uint32_t last_ = 0;
  std::uint32_t rest_ = 0;  // ticks of the unfinished millisecond
  std::uint32_t ms_;
};

}  // namespace m7
}  // namespace r4
