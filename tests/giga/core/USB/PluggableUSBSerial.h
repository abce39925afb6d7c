// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Arduino.h>

using usb_ep_t = std::uint8_t;

class USBDevice {
 public:
  bool configured();
};

namespace arduino {

class PluggableUSBDevice : public USBDevice {
 public:
  void lock();
  void unlock();
};

class USBCDC {
 public:
  // Gives the driver the bytes that it can take: none while a packet is on its way or the port is
  // closed.
  void send_nb(std::uint8_t* buffer, std::uint32_t size, std::uint32_t* actual, bool now = true);

 protected:
  void _change_terminal_connected(bool connected);
  usb_ep_t _bulk_in = 0x81;
  bool _tx_in_progress = false;
};

class USBSerial : public USBCDC {
 public:
  bool connected();
  int available();
  int read();
  void attach(
      void (*function)());  // called in the USB interrupt when a packet has come; at most four
  std::uint32_t baud();  // of the last line coding that the host has sent; 0 before the first one
};

}  // namespace arduino

arduino::PluggableUSBDevice& PluggableUSBD();
extern arduino::USBSerial _SerialUSB;  // NOLINT(bugprone-reserved-identifier): as it is called
