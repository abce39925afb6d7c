// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Arduino.h>

namespace arduino {

class USBSerial {
 public:
  bool connected();
  int available();
  int read();
  void attach(
      void (*function)());  // called in the USB interrupt when a packet has come; four at most
  std::uint32_t baud();     // of the last line coding that the host has sent; 0 before the first
  // Gives the driver what it takes now: nothing while a packet is on its way or the port is closed.
  void send_nb(std::uint8_t* buffer, std::uint32_t size, std::uint32_t* actual, bool now = true);
};

}  // namespace arduino

extern arduino::USBSerial _SerialUSB;  // NOLINT(bugprone-reserved-identifier): as it is called
