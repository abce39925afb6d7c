// SPDX-License-Identifier: GPL-3.0-or-later
// An ICM-20948 by its registers (InvenSense DS-000189 rev. 1.3, 7 and 8), asleep at power-on.
#pragma once

#include <cstdint>

#include "register_device.hpp"

namespace r4 {
namespace sim {

class Icm20948Model final : public RegisterDevice {
 public:
  static constexpr std::uint8_t address = 0x69;  // AD0 high: an MPU-6050 has 0x68

  Icm20948Model() : RegisterDevice(address) { power_on(); }
  void power_on() override;

  // Thousandths of g (x, y, z), degrees per second, hundredths of a degree Celsius.
  void feel(const std::int32_t (&milli_g)[3], const std::int32_t (&deg_per_s)[3],
            std::int32_t centi_c);

 private:
  static constexpr int bank_count = 4;
  static constexpr int bank_size = 0x80;
  std::uint8_t read_register(std::uint8_t at) override;
  void write_register(std::uint8_t at, std::uint8_t byte) override;
  void latch() override;
  void put(int at, std::int32_t value);

  std::uint8_t registers_[bank_count][bank_size];
  int bank_ = 0;
  std::int32_t milli_g_[3] = {0, 0, 1000};
  std::int32_t deg_per_s_[3] = {0, 0, 0};
  std::int32_t centi_c_ = 2100;
};

}  // namespace sim
}  // namespace r4
