// SPDX-License-Identifier: GPL-3.0-or-later
#include "simulated_hardware.hpp"

namespace r4 {
namespace sim {

namespace {

firmware::BoardHardware::Config config_of(const Wiring& wiring, ChipTrouble trouble) {
  firmware::BoardHardware::Config config;
  config.wiring = wiring;
  config.wiring_trouble = trouble;
  return config;
}

unsigned answers(BoardChips& chips) {
  std::uint8_t mode = 0;
  const bool answer = chips.bus.write_read(firmware::Pca9685::all_call_address, nullptr, 0, &mode,
                                           1) == firmware::I2cResult::ok;
  return answer ? 1U << chips.wiring.at(SignalKind::chip_bus).number() : 0U;
}

constexpr int ticks_per_ms = 40;

}  // namespace

SimulatedHardware::SimulatedHardware(BoardModel& board, const Wiring& wiring, ChipTrouble trouble)
    : board_(board),
      choice_(firmware::choose_bus(wiring, answers(board.chips()), trouble)),
      hardware_(board.chips().bus, board.microcontroller_pins(wiring),
                config_of(wiring, choice_.wiring_trouble)),
      i2c_(board.devices().bus),
      uarts_{firmware::UserUart(board.devices().uarts[0]),
             firmware::UserUart(board.devices().uarts[1])} {
  static_assert(firmware::BoardHardware::step_tick_hz == 1000 * ticks_per_ms, "");
  for (int i = 0; i < encoder_channels; ++i) {
    a_[i] = &board.input_at(wiring.at(SignalKind::encoder_a, i + 1));
    b_[i] = &board.input_at(wiring.at(SignalKind::encoder_b, i + 1));
    index_[i] = &board.input_at(wiring.at(SignalKind::encoder_index, i + 1));
  }
  for (int i = 0; i < ultrasonic_channels; ++i) {
    echo_[i] = &board.input_at(wiring.at(SignalKind::echo, i + 1));
  }
}

void SimulatedHardware::on_edge(const firmware::InputPin& pin, bool high, std::uint32_t at_us) {
  for (int i = 0; i < encoder_channels; ++i) {
    firmware::QuadratureEncoder& encoder = hardware_.encoder(i + 1);
    if (&pin == a_[i] || &pin == b_[i]) encoder.sample(a_[i]->read(), b_[i]->read());
    if (&pin == index_[i]) encoder.index(high);
  }
  for (int i = 0; i < ultrasonic_channels; ++i) {
    if (&pin == echo_[i]) hardware_.ultrasonic().echo(i, high, at_us);
  }
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
  const int ticks = hardware_.stepping() ? ticks_per_ms : 1;
  for (int i = 0; i < ticks; ++i) hardware_.step_tick();
  if (loop_turns) hardware_.poll(now_us_);
}

}  // namespace sim
}  // namespace r4
