// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace r4 {

struct SerialPort {
  std::string path;           // "/dev/ttyACM0"
  std::string description;    // "Giga"; may be empty
  std::string serial_number;  // serial number of the USB device; may be empty
  std::uint16_t vid = 0;      // 0: not a USB device
  std::uint16_t pid = 0;
  bool is_r4 = false;  // an Arduino Giga R1 with a sketch running, by vid and pid
};

// Sorted by path. Throws only if memory is used up. `folder`: the kernel's list of terminals.
std::vector<SerialPort> list_serial_ports(const std::string& folder = "/sys/class/tty");

// The URL of the port: by serial number, which stays valid under any path, else by path.
std::string url_of(const SerialPort& port);

}  // namespace r4
