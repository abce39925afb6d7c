// SPDX-License-Identifier: GPL-3.0-or-later
// The commands that set a device up, in order: they check that it is the one that is described,
// write to it, and have the board read it again and again.
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

// Bytes as a command has them: "x3b00".
template <class Bytes>
std::string hex_of(const Bytes& bytes) {
  return fmt::format("x{:02x}", fmt::join(bytes.begin(), bytes.end(), ""));
}

struct DeviceStep {
  CommandKind kind = CommandKind::i2c_read;  // or i2c_write, i2c_poll
  int address = 0;
  std::string bytes;  // of the register, or to be written: "x3b00"
  int count = 0;
  std::vector<std::uint8_t> expected;        // i2c_read; empty: anything
  std::chrono::milliseconds wait{0};         // i2c_write, afterwards
  int slot = 0;                              // i2c_poll, whose count 0 empties it
  std::chrono::milliseconds poll_period{0};  // i2c_poll
  bool is_answered() const { return kind != CommandKind::i2c_poll; }  // by I2CX
  // Views `bytes`.
  Command command() const;
};

std::vector<DeviceStep> steps_of(const Device& device);

// The longest time that all steps take, if each has `timeout`.
std::chrono::milliseconds longest(const Device& device, std::chrono::milliseconds timeout);

// The problem if the device does not answer, or is another device.
std::optional<Problem> trouble_with(const Device& device, const DeviceStep& step,
                                    const I2cAnswer& answer);

// The chosen fields (as in F) and those of the device. Empty if nothing has to be chosen: `chosen`
// has the device's fields already, or is empty and leaves the choice to the board.
std::string fields_with(const std::string& chosen, const Device& device);

}  // namespace r4
