// SPDX-License-Identifier: GPL-3.0-or-later
#include "system.hpp"

#include "chip/board_clock.hpp"
#include "chip/fault.hpp"
#include "chip/interrupt_stack.hpp"
#include "chip/true_random.hpp"

namespace r4 {
namespace giga {

namespace {

std::uint32_t random_number() {
  std::uint32_t number = 0;
  constexpr std::uint32_t scatter = 2654435761U;
  const bool good = true_random(reinterpret_cast<std::uint8_t*>(&number), sizeof number);
  return good ? number : BoardClock::now_us() * scatter;
}

}  // namespace

void System::boot() {
  guard_against_faults();
  mark_interrupt_stacks();
  const FaultNote last_boot = take_fault_note();
  BoardClock::start(random_number());

  if (last_boot.in_store) {
    store_.avoid();
  } else {
    store_.start();
  }
  const std::uint32_t began_us = BoardClock::now_us();
  while (store_.state() == StoreState::loading &&
         BoardClock::now_us() - began_us < settings_limit_us) {
    Watchdog::feed();
    rtos::ThisThread::sleep_for(std::chrono::milliseconds(1));
  }
  Settings settings;
  store_.load(settings);
  const SiteSettings& site = settings.site;
  Machine& machine =
      machine_.make(site.wiring, firmware::BoardHardware::trouble_of(site.wiring_source), buses_);
  guard_outputs(machine.hardware());

  // A higher priority than the network's thread, which therefore cannot delay the loop.
  osThreadSetPriority(osThreadGetId(), osPriorityAboveNormal);
  board_.make(machine, store_, settings, last_boot).start();
}

}  // namespace giga
}  // namespace r4
