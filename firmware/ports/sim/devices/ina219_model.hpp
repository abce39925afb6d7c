// SPDX-License-Identifier: GPL-3.0-or-later
// An INA219 by its registers (TI SBOS448G, 8.6): bus voltage, and current through a shunt.
// Registers have 16 bits, higher byte first; a read repeats the pointer's register.
#pragma once

#include <cstdint>

#include "../chips/i2c_chip_model.hpp"

namespace r4 {
namespace sim {

class Ina219Model final : public I2cChipModel {
 public:
  static constexpr std::uint8_t address = 0x40;  // A1 and A0 at ground

  void power_on() override;
  bool start(std::uint8_t to, bool read) override;
  bool write(std::uint8_t byte) override;
  std::uint8_t read() override;

  // Millivolts on the bus, microvolts over the shunt.
  void measure(std::int32_t bus_mv, std::int32_t shunt_uv) {
    bus_mv_ = bus_mv;
    shunt_uv_ = shunt_uv;
  }

 private:
  std::uint16_t value_of(std::uint8_t at) const;

  std::uint16_t configuration_ = 0x399F;
  std::uint16_t calibration_ = 0;
  std::uint8_t pointer_ = 0;
  std::uint8_t byte_ = 0;  // index in the transfer; 0: the pointer or the higher byte
  std::uint8_t high_ = 0;
  std::uint16_t latched_ = 0;  // the lower byte of this value is read next
  std::int32_t bus_mv_ = 12160;
  std::int32_t shunt_uv_ = 125000;  // 1.25 A through 0.1 ohm
};

}  // namespace sim
}  // namespace r4
