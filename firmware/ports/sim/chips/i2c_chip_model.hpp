// SPDX-License-Identifier: GPL-3.0-or-later
// A chip on the simulated I2C bus, as the bus sees it: addresses, bytes, STOP and time.
#pragma once

#include <cstdint>

namespace r4::sim {

class I2cChipModel {
 public:
  virtual ~I2cChipModel() = default;

  // Power comes, or comes back: every register at its reset value.
  virtual void power_on() = 0;
  // START (or repeated START) and an address. True: the chip acknowledges and takes part.
  virtual bool start(std::uint8_t address, bool read) = 0;
  // A byte for the chip. True: it acknowledges.
  virtual bool write(std::uint8_t byte) = 0;
  // The chip's next byte.
  virtual std::uint8_t read() = 0;
  // The end of a transfer in which the chip took part.
  virtual void stop() {}
  // The time is now `now_us`.
  virtual void set_time(std::uint64_t now_us) { static_cast<void>(now_us); }
};

}  // namespace r4::sim
