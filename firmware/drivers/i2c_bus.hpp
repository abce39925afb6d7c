// SPDX-License-Identifier: GPL-3.0-or-later
// The I2C bus as the chip drivers need it (NXP UM10204): whole transfers, a result, and a way out
// when a chip holds the lines.
//
// Every call is bounded: it returns within its own time on the wire (i2c_wire_us) plus
// i2c_timeout_us, whatever the chips do. A port whose library waits longer must not use that
// library. Each transfer ends with STOP, also after an error.
#pragma once

#include <cstddef>
#include <cstdint>

namespace r4 {
namespace firmware {

enum class I2cResult : std::uint8_t {
  ok,
  no_acknowledge,  // nobody answered to the address, or a byte was refused
  timeout,         // a line is held low, or recover() cut this transfer short
};

constexpr std::uint32_t i2c_timeout_us = 1000;

// What a transfer of `bytes` bytes (addresses included) takes at 400 kHz: nine clocks a byte, one
// each for START (or repeated START) and STOP.
constexpr std::uint32_t i2c_wire_us(std::size_t bytes, std::size_t starts = 1) {
  return static_cast<std::uint32_t>((bytes * 9 + starts + 1) * 5 / 2);
}

class I2cBus {
 public:
  // Sends `size` bytes to the 7-bit `address`.
  virtual I2cResult write(std::uint8_t address, const std::uint8_t* bytes, std::size_t size) = 0;
  // Sends `out_size` bytes (0: none, read at once), then reads `in_size` after a repeated START.
  // What is in `in` after an error is undefined.
  virtual I2cResult write_read(std::uint8_t address, const std::uint8_t* out, std::size_t out_size,
                               std::uint8_t* in, std::size_t in_size) = 0;
  // Nine clocks and a STOP (UM10204 section 3.1.16), so that a chip that was cut off in mid-byte
  // lets go of SDA. True if both lines are high then. May be called in an interrupt or a fault
  // handler while a transfer is under way: that transfer, if it is ever resumed, returns timeout.
  virtual bool recover() = 0;

 protected:
  ~I2cBus() = default;
};

}  // namespace firmware
}  // namespace r4
