// SPDX-License-Identifier: GPL-3.0-or-later
// CAN frames as text for tests: "10 14 61 62".
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "r4link/can/can_frame.hpp"

namespace r4::test {

// A classic frame. If there are more than 8 bytes: an FD frame.
inline CanFrame frame_of(std::uint32_t id, const std::string& hex) {
  CanFrame frame{};
  frame.id = id;
  const char* at = hex.c_str();
  for (char* end = nullptr; *at != '\0'; at = end) {
    frame.data[frame.size++] = static_cast<std::uint8_t>(std::strtoul(at, &end, 16));
  }
  frame.fd = frame.size > max_classic_size;
  return frame;
}

inline std::string hex_of(const CanFrame& frame) {
  std::string hex;
  for (int i = 0; i < frame.size; ++i) {
    char byte[4];
    std::snprintf(byte, sizeof byte, "%02X", frame.data[i]);
    hex += (i == 0 ? "" : " ") + std::string(byte);
  }
  return hex;
}

// `count` bytes that count up from `first`, in hexadecimal.
inline std::string counting(int count, int first = 1) {
  CanFrame frame{};
  std::string hex;
  for (int i = 0; i < count; ++i) {
    frame.size = 1;
    frame.data[0] = static_cast<std::uint8_t>(first + i);
    hex += (i == 0 ? "" : " ") + hex_of(frame);
  }
  return hex;
}

// `count` bytes that count up from `first`.
inline std::string counted(std::size_t count, int first = 1) {
  std::string bytes(count, '\0');
  std::generate(bytes.begin(), bytes.end(), [&] { return static_cast<char>(first++); });
  return bytes;
}

}  // namespace r4::test
