// SPDX-License-Identifier: GPL-3.0-or-later
// The application between its transports and its hardware, constructed after the settings are read.
#pragma once

#include <cstdint>

#include "../../application/application.hpp"
#include "boot_report.hpp"
#include "chip/board_clock.hpp"
#include "links/can_port.hpp"
#include "links/network.hpp"
#include "links/usb_port.hpp"
#include "machine.hpp"
#include "settings_store.hpp"
#include "status_light.hpp"

namespace r4 {
namespace giga {

class BoardProgram {
 public:
  BoardProgram(Machine& machine, SettingsStore& store, const Settings& settings,
               const FaultNote& last_boot);

  // Starts transports, application and timers. Then the guard decides when the watchdog is fed.
  void start();
  // One turn of the loop. Never waits for anything outside the board.
  void poll();

  firmware::Application& application() { return application_; }

 private:
  void hear();
  void receive(std::uint8_t port, std::uint32_t peer, Text datagram);
  void stay_safe_for_upload();
  void hear_usb(Text line);
  void follow_settings(std::uint32_t now_ms);
  void use(const Settings& settings);
  void tell_report();
  BootReport::Sources report_sources(const FaultNote& last_boot);

  Machine& machine_;
  SettingsStore& store_;
  UsbPort usb_;
  UdpLink udp_link_;
  UdpPort udp_{udp_link_, &BoardClock::now_ms};
  Network network_{udp_link_};
  Fdcan fdcan_;
  CanPort can_;
  firmware::Application application_;
  BootReport report_;
  StatusLight light_;

  Settings used_;  // in use by hardware and network
  Settings kept_;  // in the store
  bool changed_ = false;
  std::uint32_t changed_ms_ = 0;
  SafeReason last_boot_;
  char report_line_[BootReport::max_line];
  Text waiting_line_;
  std::uint8_t usb_number_ = 0;
  std::uint8_t udp_number_ = 0;
  std::uint8_t can_number_ = 0;
};

}  // namespace giga
}  // namespace r4
