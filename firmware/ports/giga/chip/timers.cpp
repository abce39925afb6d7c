// SPDX-License-Identifier: GPL-3.0-or-later
#include "timers.hpp"

#include <atomic>

#include "board_clock.hpp"
#include "chip.hpp"
#include "fault.hpp"
#include "interrupt_stack.hpp"
#include "watchdog.hpp"

namespace r4 {
namespace giga {

namespace {

// Used by interrupt handlers. NOLINTBEGIN
StepTick* stepping = nullptr;
firmware::Guard* guarding = nullptr;
std::uint32_t fed_ms = 0;
std::atomic<bool> awake{false};
// NOLINTEND

constexpr std::uint32_t woken = 1;
rtos::EventFlags& loop_flags() {
  static rtos::EventFlags flags;
  return flags;
}

void step() {
  TIM7->SR = 0;
  stepping->step_tick();
}
void on_step_timer() { on_own_stack(&step); }

void look() {
  FaultNote note;
  if (!interrupt_stacks_whole()) {
    note.kind = FaultNote::Kind::stack;
    end_boot(note);
  }
  const std::uint32_t now_ms = BoardClock::now_ms();
  if (guarding->tick(now_ms)) {
    Watchdog::feed();
    fed_ms = now_ms;
  } else if (now_ms - fed_ms >= starve_ms) {
    note.kind = FaultNote::Kind::watchdog;
    end_boot(note);
  }
  wake_loop();
}
void on_stop() { on_own_stack(&look); }

void pass_millisecond() {
  BoardClock::advance();
  look();
}
void on_millisecond() { on_own_stack(&pass_millisecond); }

}  // namespace

// If the bus runs undivided: the bus clock. Otherwise: twice the bus clock (RM0399, chapter RCC).
std::uint32_t timer_input_hz() {
  const std::uint32_t bus_hz = HAL_RCC_GetPCLK1Freq();
  return bus_hz == HAL_RCC_GetHCLKFreq() ? bus_hz : 2 * bus_hz;
}

void start_step_timer(StepTick& tick) {
  constexpr std::uint32_t rcc_tim7_on = 1U << 5;
  constexpr std::uint32_t update_interrupt = 1;
  constexpr std::uint32_t on = 1;
  stepping = &tick;
  RCC->APB1LENR |= rcc_tim7_on;
  static_cast<void>(static_cast<std::uint32_t>(RCC->APB1LENR));
  TIM7->PSC = 0;
  TIM7->ARR = timer_input_hz() / step_tick_hz - 1;
  TIM7->EGR = 1;  // loads prescaler and period
  TIM7->SR = 0;
  TIM7->DIER = update_interrupt;
  NVIC_SetVector(TIM7_IRQn, reinterpret_cast<std::uintptr_t>(&on_step_timer));
  NVIC_EnableIRQ(TIM7_IRQn);
  TIM7->CR1 = on;
}

void start_guard_timer(firmware::Guard& guard) {
  static mbed::Ticker ticker;
  guarding = &guard;
  fed_ms = BoardClock::now_ms();
  awake = false;
  loop_flags();
  NVIC_SetVector(MDIOS_IRQn, reinterpret_cast<std::uintptr_t>(&on_stop));
  NVIC_SetPriority(MDIOS_IRQn, 0);  // the ticker's priority: neither handler interrupts the other
  NVIC_EnableIRQ(MDIOS_IRQn);
  ticker.attach(mbed::callback(&on_millisecond), std::chrono::microseconds(1000));
}

void stop_at_once() {
  guarding->stop();
  NVIC_SetPendingIRQ(MDIOS_IRQn);
}

// Sets the flag only once: late ticks share one interrupt, which may set at most 16 flags.
void wake_loop() {
  if (!awake.exchange(true)) loop_flags().set(woken);
}

void rest() {
  loop_flags().wait_any_for(woken, std::chrono::milliseconds(2));
  awake = false;
}

}  // namespace giga
}  // namespace r4
