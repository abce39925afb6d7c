// SPDX-License-Identifier: GPL-3.0-or-later
// The whole firmware.
//     System()   starts the watchdog; every output off
//     boot()     guards against faults, reads the settings (at most 2 s), starts everything else
//     poll()     one turn of the loop
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
  BoardProgram& board() { return *board_; }  // only after boot()

 private:
  static constexpr std::uint32_t settings_limit_us = 2000000;  // then the defaults
  struct WatchdogOn {
    WatchdogOn() { Watchdog::start(); }
  };

  WatchdogOn watchdog_on_;  // must be first
  Machine machine_;
  SettingsStore store_;
  alignas(BoardProgram) unsigned char board_place_[sizeof(BoardProgram)];
  BoardProgram* board_ = nullptr;
};

}  // namespace giga
}  // namespace r4
