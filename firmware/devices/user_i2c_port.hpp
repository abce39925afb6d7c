// SPDX-License-Identifier: GPL-3.0-or-later
// The user's I2C bus as its driver needs it. No call waits.
#pragma once

#include <cstddef>
#include <cstdint>

namespace r4 {
namespace firmware {

// Sends `out`, then reads `in` after a repeated START. Either may be empty; both empty: a probe.
struct UserTransfer {
  std::uint8_t address = 0;
  const std::uint8_t* out = nullptr;
  std::size_t out_size = 0;
  std::uint8_t* in = nullptr;
  std::size_t in_size = 0;
};

class UserI2cPort {
 public:
  enum class Progress : std::uint8_t {
    busy,
    done,
    refused,  // no device answered, or a byte was refused; the bus is free
    lost,     // the lines did not follow the controller
  };

  // The buffers are in use until progress() is not busy, or until release().
  virtual void begin(const UserTransfer& transfer) = 0;
  virtual Progress progress() = 0;

  // Aborts the transfer and releases both lines. Until resume(), drive() sets the lines.
  virtual void release() = 0;
  // Open drain: high releases a line, and a device may hold it low.
  virtual void drive(bool scl, bool sda) = 0;
  virtual bool scl_is_high() = 0;
  virtual bool sda_is_high() = 0;
  virtual void resume() = 0;

 protected:
  ~UserI2cPort() = default;
};

}  // namespace firmware
}  // namespace r4
