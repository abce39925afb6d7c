// SPDX-License-Identifier: GPL-3.0-or-later
// The I2C bus for the chip drivers (NXP UM10204). Every call returns within i2c_most_us, so a port
// must not use a library that waits longer. Each transfer ends with STOP, even after an error.
#pragma once

#include <cstddef>
#include <cstdint>

namespace r4 {
namespace firmware {

enum class I2cResult : std::uint8_t {
  ok,
  no_acknowledge,  // no chip answered the address, or a byte was refused
  timeout,         // a line is held low, or recover() cut this transfer short
};

constexpr std::uint32_t i2c_timeout_us = 1000;

// At 400 kHz, addresses included: nine clocks per byte, one per START and one for STOP.
constexpr std::uint32_t i2c_wire_us(std::size_t bytes, std::size_t starts = 1) {
  return static_cast<std::uint32_t>((bytes * 9 + starts + 1) * 5 / 2);
}

// The longest time of recover(): nine clocks and a STOP at 100 kHz, with SCL stretched each time.
constexpr std::uint32_t i2c_recovery_us = 450;

// The longest time of a transfer: two attempts, their waits, and a recovery between them.
constexpr std::uint32_t i2c_most_us(std::size_t bytes, std::size_t starts = 1) {
  return 2 * i2c_wire_us(bytes, starts) + i2c_timeout_us + i2c_recovery_us;
}

class I2cBus {
 public:
  // `address`: 7 bits.
  virtual I2cResult write(std::uint8_t address, const std::uint8_t* bytes, std::size_t size) = 0;
  // Sends `out_size` bytes (0: none, reads at once), then reads `in_size` after a repeated START.
  // After an error the contents of `in` are undefined.
  virtual I2cResult write_read(std::uint8_t address, const std::uint8_t* out, std::size_t out_size,
                               std::uint8_t* in, std::size_t in_size) = 0;
  // Nine clocks and a STOP (UM10204 3.1.16): a chip cut off in mid-byte releases SDA. True if both
  // lines are high. May interrupt a transfer (which returns timeout), also in a fault handler.
  virtual bool recover() = 0;

 protected:
  ~I2cBus() = default;
};

}  // namespace firmware
}  // namespace r4
