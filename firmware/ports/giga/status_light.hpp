// SPDX-License-Identifier: GPL-3.0-or-later
// Colours of the Giga's light (docs/how-to/firmware.md):
//     green, flashing   no host yet                blue            the host is silent or has left
//     green             a host is in control       red, flashing   handle or proximity
//                                                  red             stop, fault or watchdog
#pragma once

#include <cstdint>

#include "../../application/observer.hpp"
#include "pins.hpp"

namespace r4 {
namespace giga {

class StatusLight {
 public:
  void show(firmware::BoardState state, SafeReason reason, std::uint32_t now_ms) {
    const bool flash = (now_ms / half_period_ms) % 2 == 0;
    bool red = false;
    bool green = false;
    bool blue = false;
    switch (reason) {
      case SafeReason::none:
        green = true;
        break;
      case SafeReason::link:
        green = state == firmware::BoardState::connecting && flash;
        blue = state != firmware::BoardState::connecting;
        break;
      case SafeReason::handle:
      case SafeReason::proximity:
        red = flash;
        break;
      case SafeReason::stop:
      case SafeReason::fault:
      case SafeReason::watchdog:
        red = true;
        break;
    }
    red_.write(!red);
    green_.write(!green);
    blue_.write(!blue);
  }

 private:
  static constexpr std::uint32_t half_period_ms = 250;
  GpioOutput red_{line_of(red_led_pin)};
  GpioOutput green_{line_of(green_led_pin)};
  GpioOutput blue_{line_of(blue_led_pin)};
};

}  // namespace giga
}  // namespace r4
