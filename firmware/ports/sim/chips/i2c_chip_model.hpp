// SPDX-License-Identifier: GPL-3.0-or-later
// A chip on the simulated I2C bus, as the bus sees it: addresses, bytes, STOP and time.
#pragma once

#include <cstdint>

namespace r4 {
namespace sim {

class I2cChipModel {
 public:
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

  // From now on the chip's time is what `now_ns` says.
  void follow(const std::uint64_t& now_ns) { clock_ = &now_ns; }

 protected:
  ~I2cChipModel() = default;
  // Nanoseconds; 0 for a chip that is on no bus.
  std::uint64_t now_ns() const { return clock_ == nullptr ? 0 : *clock_; }

 private:
  const std::uint64_t* clock_ = nullptr;
};

}  // namespace sim
}  // namespace r4
