// SPDX-License-Identifier: GPL-3.0-or-later
// The whole firmware from power-up on. There is one.
//
//     System()   watchdog on; every output off
//     boot()     faults guarded; settings read (2 s at most); transports, application, timers
//     poll()     a turn of the loop
#pragma once

#include <cstdint>

#include "board_program.hpp"
#include "chip/watchdog.hpp"
#include "machine.hpp"
#include "settings_store.hpp"

namespace r4 {
namespace giga {

class System {
 public:
  System() = default;
  ~System();
  System(const System&) = delete;
  System& operator=(const System&) = delete;

  void boot();
  void poll() { board_->poll(); }
  BoardProgram& board() { return *board_; }  // after boot()

 private:
  // How long the settings may take; without them the board starts with the defaults.
  static constexpr std::uint32_t settings_limit_us = 2000000;
  struct WatchdogOn {
    WatchdogOn() { Watchdog::start(); }
  };

  WatchdogOn watchdog_on_;  // the first of all
  Machine machine_;         // all outputs are off
  SettingsStore store_;
  alignas(BoardProgram) unsigned char board_place_[sizeof(BoardProgram)];
  BoardProgram* board_ = nullptr;  // made when the settings are known
};

}  // namespace giga
}  // namespace r4
