// SPDX-License-Identifier: GPL-3.0-or-later
// A BNO055 by its registers (Bosch BST-BNO055-DS000 rev. 1.8, 3.3, 3.6 and 4): sensors and fusion.
// In CONFIGMODE the outputs are 0. Other settings can be written only in CONFIGMODE.
#pragma once

#include <cstdint>

#include "register_device.hpp"

namespace r4 {
namespace sim {

class Bno055Model final : public RegisterDevice {
 public:
  static constexpr std::uint8_t address = 0x28;  // COM3 low

  struct Motion {
    std::int32_t mm_per_s2[3] = {0, 0, 9810};
    std::int32_t nanotesla[3] = {22000, 0, -42000};
    std::int32_t mrad_per_s[3] = {0, 0, 0};
    std::int32_t centidegrees[3] = {27000, 0, 0};       // heading (clockwise), roll, pitch
    std::int32_t quaternion[4] = {11585, 0, 0, 11585};  // w, x, y, z; 16384 is 1
    std::int32_t degrees_c = 25;
  };

  Bno055Model() : RegisterDevice(address) { power_on(); }
  void power_on() override;
  void feel(const Motion& motion) { motion_ = motion; }

 private:
  static constexpr int page_size = 0x80;
  std::uint8_t read_register(std::uint8_t at) override;
  void write_register(std::uint8_t at, std::uint8_t byte) override;
  void latch() override;
  void put(int at, std::int32_t value);
  bool configures() const;

  std::uint8_t registers_[page_size];  // registers of page 0
  std::uint8_t page_ = 0;
  std::uint64_t runs_from_ns_ = 0;  // a change of mode takes time
  Motion motion_;
};

}  // namespace sim
}  // namespace r4
