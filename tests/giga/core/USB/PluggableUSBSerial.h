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
  // Gives the driver the bytes that it can accept. While a packet is being sent or the port is
  // closed, the driver accepts no bytes.
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
      void (*function)());  // called in the USB interrupt when a packet has arrived; at most four
  std::uint32_t baud();     // the newest baud rate that the host has set; 0: none yet
};

}  // namespace arduino

arduino::PluggableUSBDevice& PluggableUSBD();
extern arduino::USBSerial _SerialUSB;  // NOLINT(bugprone-reserved-identifier): as it is called
