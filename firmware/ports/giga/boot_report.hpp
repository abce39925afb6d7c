// SPDX-License-Identifier: GPL-3.0-or-later
// The report of the paper's Figure 3, with its labels, and further lines. On request, each turn
// sends one line. The I2C scan probes one address a turn: at most one transfer.
#pragma once

#include <cstdint>

#include "../../../protocol/keys/authentication.hpp"
#include "../../../protocol/link/session_paths.hpp"
#include "../../../protocol/messages/settings.hpp"
#include "../../board_hardware.hpp"
#include "../../guard.hpp"
#include "chip/fault.hpp"
#include "chip/fdcan.hpp"
#include "links/network.hpp"
#include "settings_store.hpp"

namespace r4 {
namespace giga {

class BootReport {
 public:
  // All pointers must outlive the report.
  struct Sources {
    const Settings* settings;
    firmware::I2cBus* bus;
    const firmware::BoardHardware* hardware;
    const Network* network;
    const Fdcan* can;
    const SettingsStore* store;
    const Authentication* authentication;
    const SessionPaths* paths;
    const firmware::Guard* guard;
    FaultNote last_boot;
    std::uint32_t timer_hz;
  };
  static constexpr std::size_t max_line = 96;

  explicit BootReport(const Sources& sources) : sources_(sources) {}

  void begin() {
    step_ = 1;
    address_ = first_address;
  }
  bool running() const { return step_ != 0; }
  // The next line; empty if this turn has none. Call only while running().
  Text next(char (&out)[max_line]);

 private:
  static constexpr std::uint8_t first_address = 0x08;  // the rest is reserved (UM10204 3.1.12)
  static constexpr std::uint8_t last_address = 0x77;

  Text scan(char (&out)[max_line]);
  Text chip(char (&out)[max_line]);
  static Text stacks(char (&out)[max_line]);
  Text keys(char (&out)[max_line]) const;
  Text paths(char (&out)[max_line]) const;

  Sources sources_;
  int step_ = 0;  // case of the switch in next(); 0: not running
  std::uint8_t address_ = 0;
  int chip_ = 0;
};

}  // namespace giga
}  // namespace r4
