// SPDX-License-Identifier: GPL-3.0-or-later
// The commands that set a device up: check its identity, write to it, and start the polls.
#pragma once

#include <fmt/format.h>

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "r4link/command.hpp"
#include "r4link/devices/device.hpp"
#include "r4link/error.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {

// Writes bytes as in commands: "x3b00".
template <class Bytes>
std::string hex_of(const Bytes& bytes) {
  return fmt::format("x{:02x}", fmt::join(bytes.begin(), bytes.end(), ""));
}

struct DeviceStep {
  CommandKind kind = CommandKind::i2c_read;  // or i2c_write, i2c_poll
  int address = 0;
  std::string bytes;  // register, or bytes to write: "x3b00"
  int count = 0;
  std::vector<std::uint8_t> expected;        // i2c_read; empty: any bytes
  std::chrono::milliseconds wait{0};         // after an i2c_write
  int slot = 0;                              // i2c_poll; a poll with count 0 empties the slot
  std::chrono::milliseconds poll_period{0};  // i2c_poll
  bool is_answered() const { return kind != CommandKind::i2c_poll; }  // by the field I2CX
  Command command() const;                                            // refers to `bytes`
};

std::vector<DeviceStep> steps_of(const Device& device);

// The longest time of all steps if each step may take `timeout`.
std::chrono::milliseconds longest(const Device& device, std::chrono::milliseconds timeout);

std::optional<Problem> trouble_with(const Device& device, const DeviceStep& step,
                                    const I2cAnswer& answer);

// The chosen fields (as in F) plus the device's fields. Empty: `chosen` is empty or has all.
std::string fields_with(const std::string& chosen, const Device& device);

}  // namespace r4
