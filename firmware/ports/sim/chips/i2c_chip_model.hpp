// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace r4 {
namespace sim {

class I2cChipModel {
 public:
  virtual void power_on() = 0;
  // START (or repeated START). True if the chip acknowledges and takes part.
  virtual bool start(std::uint8_t address, bool read) = 0;
  virtual bool write(std::uint8_t byte) = 0;
  virtual std::uint8_t read() = 0;
  // The end of a transfer in which the chip took part.
  virtual void stop() {}

  void follow(const std::uint64_t& now_ns) { clock_ = &now_ns; }

 protected:
  ~I2cChipModel() = default;
  // Nanoseconds; 0 for a chip without a bus.
  std::uint64_t now_ns() const { return clock_ == nullptr ? 0 : *clock_; }

 private:
  const std::uint64_t* clock_ = nullptr;
};

}  // namespace sim
}  // namespace r4
