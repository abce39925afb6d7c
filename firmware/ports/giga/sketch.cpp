// SPDX-License-Identifier: GPL-3.0-or-later
#include "sketch.hpp"

#include "board.hpp"
#include "board_clock.hpp"
#include "fault.hpp"
#include "watchdog.hpp"

r4::giga::Sketch R4Link;  // NOLINT

namespace r4 {
namespace giga {

namespace {

// How long the settings may take; without them the board starts with the defaults.
constexpr std::uint32_t settings_limit_us = 2000000;

// By the chip's generator of true random numbers.
std::uint32_t random_number() {
  std::uint32_t number = 0;
  std::size_t size = 0;
  trng_t generator;
  trng_init(&generator);
  trng_get_bytes(&generator, reinterpret_cast<std::uint8_t*>(&number), sizeof number, &size);
  trng_free(&generator);
  return size == sizeof number ? number : BoardClock::now_us() * 2654435761U;
}

Board* board = nullptr;  // NOLINT(cppcoreguidelines-avoid-non-const-global-variables)

}  // namespace

// Above the network's threads, so that they cannot keep the loop waiting.
static void raise_priority() { osThreadSetPriority(osThreadGetId(), osPriorityAboveNormal); }

void Sketch::begin() {
  if (board != nullptr) return;
  Watchdog::start();
  static Machine machine;  // all outputs are off
  guard_against_faults(machine.hardware());
  const FaultNote last_boot = take_fault_note();
  BoardClock::start(random_number());

  static SettingsStore store;
  store.start();
  const std::uint32_t began_us = BoardClock::now_us();
  while (store.state() == StoreState::loading &&
         BoardClock::now_us() - began_us < settings_limit_us) {
    machine.poll();
    Watchdog::feed();
    rtos::ThisThread::sleep_for(std::chrono::milliseconds(1));
  }
  Settings settings;
  store.loaded(settings);
  machine.hardware().fit(settings.site.chips);

  static Board the_board(machine, store, settings, last_boot);
  board = &the_board;
  raise_priority();
  board->start();
}

void Sketch::poll() {
  board->poll();
  rest();
}

}  // namespace giga
}  // namespace r4
