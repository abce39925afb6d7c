// SPDX-License-Identifier: GPL-3.0-or-later
#include "simulated_hardware.hpp"

namespace r4 {
namespace sim {

namespace {

firmware::BoardHardware::Config config() {
  firmware::BoardHardware::Config config;
  config.ultrasonic_fitted = (1U << ultrasonic_channels) - 1;
  return config;
}

constexpr int ticks_per_ms = 40;

}  // namespace

SimulatedHardware::SimulatedHardware(BoardModel& board)
    : board_(board),
      hardware_(board.chips().bus, board.microcontroller_pins(), config()),
      i2c_(board.devices().bus),
      uarts_{firmware::UserUart(board.devices().uarts[0]),
             firmware::UserUart(board.devices().uarts[1])} {
  static_assert(firmware::BoardHardware::Config().step_tick_hz == 1000 * ticks_per_ms, "");
}

void SimulatedHardware::power_up() {
  hardware_.power_up(now_us_);
  board_.devices().reset();
  board_.tell_levels(*this);
  for (int i = 0; i < boot_ms; ++i) pass_millisecond();
}

void SimulatedHardware::pass_millisecond(bool loop_turns) {
  now_us_ += 1000;
  board_.pass_millisecond(now_us_, *this);
  // The timer stands while no stepper moves.
  const int ticks = hardware_.stepping() ? ticks_per_ms : 1;
  for (int i = 0; i < ticks; ++i) hardware_.step_tick();
  if (loop_turns) hardware_.poll(now_us_);
}

}  // namespace sim
}  // namespace r4
