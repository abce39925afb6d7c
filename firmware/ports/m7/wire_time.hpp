// SPDX-License-Identifier: GPL-3.0-or-later
// The simulated bus in real time: a byte takes as long as on a wire; no interrupt divides a byte.
#pragma once

#include <cstdint>

#include "../sim/chips/i2c_bus_model.hpp"
#include "chip/board_clock.hpp"
#include "chip/registers.hpp"

namespace r4 {
namespace m7 {

class WireTime final : public sim::I2cProcessor {
 public:
  std::uint32_t hold_interrupts() override { return InterruptsHeld::hold(); }
  void release_interrupts(std::uint32_t before) override { InterruptsHeld::release(before); }
  void wait(std::uint32_t ns) override {
    const std::uint32_t began = BoardClock::ticks();
    while (BoardClock::ticks() - began < ns / ns_per_tick) {
    }
  }

 private:
  static constexpr std::uint32_t ns_per_tick = 1000 / BoardClock::ticks_per_us;
};

}  // namespace m7
}  // namespace r4
