// SPDX-License-Identifier: GPL-3.0-or-later
// A VL53L0X by its registers (ST DS11555 rev. 4, 3.2; names of ST's API, STSW-IMG005). After
// SYSRANGE_START has begun ranging, the device measures a distance by time of flight every 33 ms.
#pragma once

#include <cstdint>

#include "register_device.hpp"

namespace r4 {
namespace sim {

class Vl53l0xModel final : public RegisterDevice {
 public:
  static constexpr std::uint8_t address = 0x29;
  static constexpr std::int32_t no_target = 8190;  // reading in mm without a target

  Vl53l0xModel() : RegisterDevice(address) { power_on(); }
  void power_on() override;
  void see(std::int32_t mm) { mm_ = mm; }

 private:
  static constexpr int result_size = 12;
  std::uint8_t read_register(std::uint8_t at) override;
  void write_register(std::uint8_t at, std::uint8_t byte) override;
  void latch() override;
  void put(int at, std::int32_t value);

  std::uint8_t start_ = 0;  // SYSRANGE_START
  std::uint8_t i2c_mode_ = 0;
  std::uint8_t result_[result_size];  // from RESULT_RANGE_STATUS on
  std::uint64_t ranged_ns_ = 0;       // when ranging began, or the last range ended
  std::int32_t mm_ = 500;
};

}  // namespace sim
}  // namespace r4
