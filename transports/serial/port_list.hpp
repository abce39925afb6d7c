// SPDX-License-Identifier: GPL-3.0-or-later
// The serial ports of this machine.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace r4 {

// The Arduino Giga R1 with a sketch running.
inline constexpr std::uint16_t board_vid = 0x2341;
inline constexpr std::uint16_t board_pid = 0x0266;

struct SerialPort {
  std::string path;           // "/dev/ttyACM0"
  std::string description;    // "Giga"; may be empty
  std::string serial_number;  // of the USB device; may be empty
  std::uint16_t vid = 0;      // 0 if it is no USB device
  std::uint16_t pid = 0;
  bool is_r4 = false;  // by vid and pid
};

// In the order of their names. Empty if there are none; never throws but for memory.
std::vector<SerialPort> list_serial_ports();

// The URL that opens a port wherever it appears: by serial number where it has one.
std::string url_of(const SerialPort& port);

}  // namespace r4
