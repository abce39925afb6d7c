// SPDX-License-Identifier: GPL-3.0-or-later
// Runs timed work, even while the loop waits.
//     1 kHz    mbed::Ticker   clock, guard, watchdog if the guard allows it; wakes the loop
//     40 kHz   TIM7           stepper steps, encoder index pins
//     a stop   MDIOS_IRQn     the guard; uses the interrupt of an unused peripheral
//
// Handlers run on the stack of interrupt_stack.hpp. A 40 kHz Ticker would spend most time in the
// core's queue. If the watchdog is unfed for starve_ms, the boot ends with a note before the reset.
#pragma once

#include <cstdint>

#include "../../../guard.hpp"

namespace r4 {
namespace giga {

constexpr std::uint32_t step_tick_hz = 40000;
constexpr std::uint32_t starve_ms = 400;

class StepTick {  // called in the 40 kHz interrupt
 public:
  virtual void step_tick() = 0;

 protected:
  ~StepTick() = default;
};

void start_step_timer(StepTick& tick);
void start_guard_timer(firmware::Guard& guard);

// Call for a received E:STOP, from any interrupt or thread, after start_guard_timer().
void stop_at_once();

std::uint32_t timer_input_hz();  // TIM7's input clock

void wake_loop();  // from any interrupt or thread
void rest();       // until the loop is woken, at most 2 ms

}  // namespace giga
}  // namespace r4
