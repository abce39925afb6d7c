// SPDX-License-Identifier: GPL-3.0-or-later
// The whole firmware.
//     System()   starts the watchdog; every PWM output and voltage off
//     boot()     guards against faults, reads the settings (at most 2 s), switches all other
//                outputs off, starts everything else
//     poll()     one turn of the loop
#pragma once

#include <cstdint>

#include "board_program.hpp"
#include "buses.hpp"
#include "chip/watchdog.hpp"
#include "late.hpp"
#include "machine.hpp"
#include "settings_store.hpp"

namespace r4 {
namespace giga {

class System {
 public:
  System() = default;
  System(const System&) = delete;
  System& operator=(const System&) = delete;

  void boot();
  void poll() { board_->poll(); }
  BoardProgram& board() { return *board_; }  // only after boot()

 private:
  static constexpr std::uint32_t settings_limit_us = 2000000;  // after that, the defaults apply
  struct WatchdogOn {
    WatchdogOn() { Watchdog::start(); }
  };

  WatchdogOn watchdog_on_;  // must be first
  Buses buses_;
  SettingsStore store_;
  Late<Machine> machine_;
  Late<BoardProgram> board_;
};

}  // namespace giga
}  // namespace r4
