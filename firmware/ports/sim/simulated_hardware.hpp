// SPDX-License-Identifier: GPL-3.0-or-later
// The firmware's chip drivers on the model of the board, with their timers and interrupts.
#pragma once

#include <cstdint>

#include "../../application/application.hpp"
#include "../../board_hardware.hpp"
#include "../../bus_choice.hpp"
#include "robot/board_model.hpp"

namespace r4 {
namespace sim {

class SimulatedHardware final : private BoardModel::Interrupts {
 public:
  // `wiring`: the wiring of the settings; `trouble`: BoardHardware::Config::wiring_trouble.
  explicit SimulatedHardware(BoardModel& board, const Wiring& wiring = plan_wiring(),
                             ChipTrouble trouble = ChipTrouble::none);

  // Switches the outputs off and sets the chips up, in at most boot_ms of the board's time.
  void power_up();
  void pass_millisecond(bool loop_turns = true);

  firmware::BoardHardware& hal() { return hardware_; }
  firmware::UserI2c& i2c() { return i2c_; }
  void add_devices(firmware::Application::Config& config) {
    if (choice_.user_may) config.i2c = &i2c_;
    for (int i = 0; i < uart_channels; ++i) config.uarts[i] = &uarts_[i];
  }

  // Time for a first write of a chip's EEPROM, and for the handle to settle.
  static constexpr int boot_ms = 100;

 private:
  void on_edge(const firmware::InputPin& pin, bool high, std::uint32_t at_us) override;

  BoardModel& board_;
  const firmware::BusChoice choice_;
  firmware::BoardHardware hardware_;
  firmware::UserI2c i2c_;
  firmware::UserUart uarts_[uart_channels];
  firmware::InputPin *a_[encoder_channels], *b_[encoder_channels], *index_[encoder_channels];
  firmware::InputPin* echo_[ultrasonic_channels];
  std::uint32_t now_us_ = 0;  // time of the microcontroller's clock; wraps
};

}  // namespace sim
}  // namespace r4
