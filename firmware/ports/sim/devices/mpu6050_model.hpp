// SPDX-License-Identifier: GPL-3.0-or-later
// An MPU-6050 by its registers (InvenSense RM-MPU-6000A-00, 4.2), asleep at power-on.
#pragma once

#include <cstdint>

#include "register_device.hpp"

namespace r4 {
namespace sim {

class Mpu6050Model final : public RegisterDevice {
 public:
  static constexpr std::uint8_t address = 0x68;  // AD0 low

  Mpu6050Model() : RegisterDevice(address) { power_on(); }
  void power_on() override;

  // Thousandths of g (x, y, z), degrees per second, hundredths of a degree Celsius.
  void feel(const std::int32_t (&milli_g)[3], const std::int32_t (&deg_per_s)[3],
            std::int32_t centi_c);

 private:
  static constexpr int register_count = 0x76;
  std::uint8_t read_register(std::uint8_t at) override;
  void write_register(std::uint8_t at, std::uint8_t byte) override;
  void latch() override;
  void put(int at, std::int32_t value);

  std::uint8_t registers_[register_count];
  std::int32_t milli_g_[3] = {0, 0, 1000};
  std::int32_t deg_per_s_[3] = {0, 0, 0};
  std::int32_t centi_c_ = 2500;
};

}  // namespace sim
}  // namespace r4
