// SPDX-License-Identifier: GPL-3.0-or-later
// What sets a device up, one command after the other: is it the one that is described, what is written to it, and
// what the board is to read of it again and again.
#pragma once

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

struct DeviceStep {
  CommandKind kind = CommandKind::i2c_read;  // or i2c_write, i2c_poll
  int address = 0;
  std::string bytes;  // the register, or what is written: "x3b00"
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

// How long they take at most, where each has `timeout`.
std::chrono::milliseconds longest(const Device& device, std::chrono::milliseconds timeout);

// What is wrong with the device, if it does not answer, or is another one.
std::optional<Problem> trouble_with(const Device& device, const DeviceStep& step,
                                    const I2cAnswer& answer);

// The fields that are sent (as in F), with those of the device; empty if they are among them, or the board's own choice
// is left alone (`chosen` is empty).
std::string fields_with(const std::string& chosen, const Device& device);

}  // namespace r4
