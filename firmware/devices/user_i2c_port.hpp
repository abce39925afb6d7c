// SPDX-License-Identifier: GPL-3.0-or-later
// The user's I2C bus as its driver needs it: a controller of its own that transfers by itself, and the two
// lines when a device has to be clocked free. Nothing here waits.
#pragma once

#include <cstddef>
#include <cstdint>

namespace r4 {
namespace firmware {

// One transfer: `out` is sent, then `in` is read after a repeated START. Either may be empty; with both
// empty it asks whether anybody answers to the address.
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
    refused,  // nobody answered to the address, or a byte was refused; the bus is free again
    lost,     // the wire did not do what was sent
  };

  // Begins a transfer. Its buffers are in use until progress() says something else than busy, or release().
  virtual void begin(const UserTransfer& transfer) = 0;
  virtual Progress progress() = 0;

  // Gives up what is under way. From now on drive() sets the lines, both high first, until resume().
  virtual void release() = 0;
  // Open drain: high lets go of a line, and a device may hold it down.
  virtual void drive(bool scl, bool sda) = 0;
  virtual bool scl_is_high() = 0;
  virtual bool sda_is_high() = 0;
  virtual void resume() = 0;

 protected:
  ~UserI2cPort() = default;
};

}  // namespace firmware
}  // namespace r4
