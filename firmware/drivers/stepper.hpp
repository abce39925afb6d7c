// SPDX-License-Identifier: GPL-3.0-or-later
// A stepper motor driver with step and direction inputs (Microstep M542: a step at the rising edge,
// pulses of at least 2.5 us, direction at least 5 us before), moved by a periodic tick.
//
// tick() is called tick_hz times a second, 40 kHz or more for the board's 20000 steps a second. A
// step's pulse lasts one tick; a new direction gets a tick of its own before the next step; so one
// tick must be 5 us or longer. The speed is exact over any time: what is left of a step after each
// tick is kept as an integer.
//
// tick() may run in an interrupt, the other calls in the code that it interrupts, on one core.
// Positions are steps and wrap at 32 bits.
#pragma once

#include <atomic>
#include <cstdint>

#include "pins.hpp"

namespace r4 {
namespace firmware {

class Stepper {
 public:
  // Speeds are limited to `speed_limit` steps a second and to half the tick rate.
  Stepper(OutputPin& step, OutputPin& direction, std::int32_t tick_hz, std::int32_t speed_limit)
      : step_(step),
        direction_(direction),
        tick_hz_(tick_hz),
        limit_(speed_limit < tick_hz / 2 ? speed_limit : tick_hz / 2) {}

  // Goes to `position` at `speed` steps a second (0 and less: stays where it is).
  void go(std::int32_t position, std::int32_t speed);
  // No further step; a pulse that has begun ends with the next tick.
  void stop() { speed_.store(0, std::memory_order_relaxed); }
  // It is at 0 now, and stays.
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
  std::int32_t tick_hz_;
  std::int32_t limit_;
  std::atomic<std::int32_t> speed_{0};  // while it is 0, tick() does not look at the target
  std::atomic<std::int32_t> target_{0};
  std::atomic<std::int32_t> position_{0};
  // Of tick() alone.
  std::int32_t part_ = 0;  // of a step, in 1/tick_hz
  Heading heading_ = Heading::unknown;
  bool pulse_ = false;
};

}  // namespace firmware
}  // namespace r4
