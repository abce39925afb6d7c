// SPDX-License-Identifier: GPL-3.0-or-later
// What the board does on time, whatever its loop is waiting for.
//
//     1 kHz    mbed::Ticker   the clock; the guard, and with its leave the watchdog is fed;
//                             wakes the loop
//     40 kHz   TIM7           steps of the steppers, index lines of the encoders
//     a stop   MDIOS_IRQn     the guard; the line of a peripheral that nobody uses
//
// All on the stack of their own (interrupt_stack.hpp), which the guard's interrupt looks at, too.
// (A Ticker at 40 kHz would spend most of the time in the core's timer queue.) If the guard keeps its
// leave back for starve_ms, the board ends its boot by itself and leaves a note why, before the
// watchdog would without one.
#pragma once

#include <cstdint>

#include "../../../guard.hpp"

namespace r4 {
namespace giga {

constexpr std::uint32_t step_tick_hz = 40000;
constexpr std::uint32_t starve_ms = 400;

// What the 40 kHz tick does; in the interrupt.
class StepTick {
 public:
  virtual void step_tick() = 0;

 protected:
  ~StepTick() = default;
};

void start_step_timer(StepTick& tick);
// From now on the watchdog is fed by the guard.
void start_guard_timer(firmware::Guard& guard);

// E:STOP has come in: the guard makes the outputs safe at once. From any interrupt or thread, once
// the guard's timer has been started.
void stop_at_once();

// Hz that TIM7 counts before its divider.
std::uint32_t timer_input_hz();

// Wakes the loop; from any interrupt or thread.
void wake_loop();
// Until the loop is woken, two milliseconds at most.
void rest();

}  // namespace giga
}  // namespace r4
