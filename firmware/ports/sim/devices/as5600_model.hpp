// SPDX-License-Identifier: GPL-3.0-or-later
// An AS5600 by its registers (ams data sheet v1-06, "Register Description"), no burnt settings.
#pragma once

#include <cstdint>

#include "register_device.hpp"

namespace r4 {
namespace sim {

class As5600Model final : public RegisterDevice {
 public:
  static constexpr std::uint8_t address = 0x36;
  enum class Magnet : std::uint8_t { missing, too_weak, right, too_strong };

  As5600Model() : RegisterDevice(address) { power_on(); }
  void power_on() override;
  // In 4096ths of a turn: 0 to 4095.
  void turn(std::int32_t angle) { angle_ = static_cast<std::uint16_t>(angle & 0xFFF); }
  void set_magnet(Magnet magnet) { magnet_ = magnet; }

 private:
  static constexpr int setting_count = 0x09;  // ZMCO, ZPOS, MPOS, MANG, CONF
  std::uint8_t read_register(std::uint8_t at) override;
  void write_register(std::uint8_t at, std::uint8_t byte) override;
  void latch() override { latched_ = angle_; }
  // The pointer stays at an angle, for repeated reads.
  std::uint8_t after(std::uint8_t at) const override;
  std::uint16_t setting(int at) const;
  std::uint16_t output() const;

  std::uint8_t settings_[setting_count];
  std::uint16_t angle_ = 1024;
  std::uint16_t latched_ = 0;
  Magnet magnet_ = Magnet::right;
};

}  // namespace sim
}  // namespace r4
