// SPDX-License-Identifier: GPL-3.0-or-later
// Drives a Microstep M542: steps at rising edges, pulse >= 2.5 us, direction >= 5 us before.
//
// Call tick() tick_hz times per second, at least 40 kHz for the board's 20000 steps/s. A pulse
// lasts one tick, and a new direction gets a tick before the next step, so a tick is at least 5 us.
// Remainders of steps are kept, so the speed is exact. tick() may run in an interrupt, other calls
// in the code that it interrupts, on one core. Positions are steps, and wrap at 32 bits.
#pragma once

#include <atomic>
#include <cstdint>

#include "pins.hpp"

namespace r4 {
namespace firmware {

class Stepper {
 public:
  // Speeds are limited to `speed_limit` steps per second and to half the tick rate.
  Stepper(OutputPin& step, OutputPin& direction, std::int32_t tick_hz, std::int32_t speed_limit,
          bool low_is_forward = false)
      : step_(step),
        direction_(direction),
        low_is_forward_(low_is_forward),
        tick_hz_(tick_hz),
        limit_(speed_limit < tick_hz / 2 ? speed_limit : tick_hz / 2) {}

  // Moves at `speed` steps per second; 0 or less: does not move.
  void go(std::int32_t position, std::int32_t speed);
  // A pulse that has begun ends with the next tick.
  void stop() { speed_.store(0, std::memory_order_relaxed); }
  void zero();
  void tick();

  std::int32_t position() const { return position_.load(std::memory_order_relaxed); }
  bool moving() const {
    return speed_.load(std::memory_order_relaxed) > 0 &&
           position() != target_.load(std::memory_order_relaxed);
  }

 private:
  enum class Heading : std::uint8_t { unknown, forward, backward };

  OutputPin& step_;
  OutputPin& direction_;
  bool low_is_forward_;
  std::int32_t tick_hz_;
  std::int32_t limit_;
  std::atomic<std::int32_t> speed_{0};  // while it is 0, tick() ignores the target
  std::atomic<std::int32_t> target_{0};
  std::atomic<std::int32_t> position_{0};
  // Used by tick() only.
  std::int32_t part_ = 0;  // fraction of a step, in 1/tick_hz
  Heading heading_ = Heading::unknown;
  bool pulse_ = false;
};

}  // namespace firmware
}  // namespace r4
