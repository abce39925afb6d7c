// SPDX-License-Identifier: GPL-3.0-or-later
// The PCA9685 by its data sheet (Rev. 4), without OE pin (held low), phase of pulses and test mode.
// With EXTCLK, which has no clock, outputs keep their levels, pulses high: the worst case.
#pragma once

#include <cstdint>

#include "i2c_chip_model.hpp"

namespace r4 {
namespace sim {

class Pca9685Model final : public I2cChipModel {
 public:
  static constexpr int channels = 16;

  explicit Pca9685Model(std::uint8_t address) : address_(address) {}

  int duty(int channel) const;  // 0-4096 of 4096; 0 while the oscillator is off
  bool high(int channel) const { return duty(channel) == 4096; }
  std::int32_t pulse_ns(int channel) const { return duty(channel) * (reg(0xFE) + 1) * 40; }
  double pulse_us(int channel) const { return pulse_ns(channel) / 1000.0; }
  double frequency_hz() const { return 25e6 / (4096.0 * (reg(0xFE) + 1)); }
  std::uint8_t reg(std::uint8_t number) const { return registers_[number]; }

  void disturb(std::uint8_t number, std::uint8_t bits) {
    registers_[number] ^= bits;
    show();
  }

  void power_on() override;
  bool start(std::uint8_t address, bool read) override;
  bool write(std::uint8_t byte) override;
  std::uint8_t read() override;
  void stop() override;

 private:
  enum class Phase : std::uint8_t { idle, control, data, general_call, reset_wanted };

  void write_register(std::uint8_t value);
  void write_mode1(std::uint8_t value);
  void next_register();
  void show();
  bool running() const;
  bool clock_stands() const;

  std::uint8_t address_;
  std::uint8_t registers_[256] = {};
  std::uint8_t active_[4 * channels] = {};  // LED0_ON_L … as the outputs have them
  std::uint8_t pointer_ = 0;
  Phase phase_ = Phase::idle;
  bool led_written_ = false;  // an LED register was written since the last STOP
  bool restart_wanted_ = false;
  std::uint64_t awake_since_ns_ = 0;
};

}  // namespace sim
}  // namespace r4
