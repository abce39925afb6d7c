// SPDX-License-Identifier: GPL-3.0-or-later
// NXP PCA9685: sixteen 12-bit PWM outputs of one frequency (data sheet Rev. 4).
//     register          value                                                   section
//     00 MODE1          RESTART 80, EXTCLK 40, AI 20, SLEEP 10, SUB1-3 0E,       7.3.1
//                       ALLCALL 01; reset 11
//     01 MODE2          INVRT 10, OCH 08, OUTDRV 04, OUTNE 03; reset 04          7.3.2
//     06+4n …           LEDn_ON_L, ON_H, OFF_L, OFF_H: counts 0-4095; bit 4 of   7.3.3
//                       H: full on, full off; OFF wins; reset full off
//     FA-FD ALL_LED     the same for all sixteen; reads 0                        7.3.4
//     FE PRE_SCALE      25 MHz / (4096 f), rounded, - 1; at least 3; written     7.3.5
//                       only in SLEEP
//
// Set-up: all outputs off, SLEEP with AI and ALLCALL, PRE_SCALE, awake, RESTART in a poll 500 us
// later (7.3.1.1), all off again (undefined after an orderly shutdown), a check of the registers.
//
// All outputs of one transfer change together on STOP. A short budget splits a burst of changed
// registers only between pairs of channels (pair()), so the two lines of a motor change together.
//
// The chip has no timeout: it keeps driving when the microcontroller fails. all_off() makes all
// chips safe in three bytes, but a disturbance can defeat it. INVRT turns "off" into "on", and with
// EXTCLK the outputs wait for a missing clock. Only a reset clears EXTCLK. So the modes are read
// back after a safe state. If EXTCLK or MODE2 is not as written, lost_mode() requests reset_all().
#pragma once

#include <cstddef>
#include <cstdint>

#include "chip_driver.hpp"

namespace r4 {
namespace firmware {

class Pca9685 final : public ChipDriver {
 public:
  static constexpr int channels = 16;
  static constexpr std::uint8_t all_call_address = 0x70;
  static constexpr std::uint32_t oscillator_us = 500;
  // Counts from the start of the poll that wakes the chip. That poll may use the bus for 1500 us.
  static constexpr std::uint32_t wake_wait_us = oscillator_us + 1500;

  static constexpr std::uint8_t prescale_for(std::uint32_t hz) {
    return static_cast<std::uint8_t>((25000000U + 2048U * hz) / (4096U * hz) - 1U);
  }

  // `frequency_hz`: 24-1526.
  Pca9685(I2cBus& bus, std::uint8_t address, std::uint32_t frequency_hz);

  // After this call, channels `a` and `b` change together. One transfer of a poll must be able to
  // write all registers from `a` to `b`. Each channel has at most one partner.
  void pair(int a, int b);
  // Channels 0-15. Changes take effect at the next write.
  void set_duty(int channel, std::uint16_t duty);  // 0: off; 4095 and more: on; otherwise n/4096
  void set_level(int channel, bool high) { set_duty(channel, high ? duty_on : 0); }
  // `us`: microseconds, to the nearest count (4.88 us at 50 Hz); 0: no pulses.
  void set_pulse_us(int channel, std::uint16_t us);

  void want_safe() override;
  I2cResult make_safe() override;
  // Every output of every PCA9685 off: 70 <- FD 10. An acknowledge: at least one chip received it.
  static I2cResult all_off(I2cBus& bus);
  // Software reset (7.6): 00 <- 06. Turns all outputs of every PCA9685 off. Resets every chip that
  // obeys the general call, the MCP4728 too. All these chips then need their set-up.
  static I2cResult reset_all(I2cBus& bus);
  // True if the modes had bits that change what "off" means. False again after begin().
  bool lost_mode() const { return lost_mode_; }

 private:
  static constexpr int registers = 4 * channels;
  static constexpr std::uint16_t duty_on = 4095;
  enum class Step : std::uint8_t { off, sleep, prescale, wake, restart, clear, check };

  void on_begin() override;
  bool set_up(std::uint32_t now_us, BusBudget& budget) override;
  void on_write_changes(BusBudget& budget) override;
  void on_verify(BusBudget& budget) override;
  bool check_mode(BusBudget& budget);
  bool check_frequency(BusBudget& budget);
  bool wanted(int index, std::uint8_t& value) const;
  struct Registers;
  void take_differing(int channel, Registers& found) const;
  std::uint16_t next_burst(std::size_t most, Registers& burst);

  std::uint8_t prescale_;
  std::uint8_t partner_[channels];  // the channel's own number: no partner
  Step step_ = Step::off;
  std::uint32_t awake_us_ = 0;
  std::uint8_t verified_channel_ = 0;
  bool lost_mode_ = false;
  static constexpr std::uint16_t all_channels = 0xFFFF;
  std::uint16_t changed_ = all_channels;  // bit: duty_ may differ from written_
  std::uint16_t duty_[channels] = {};
  std::uint8_t written_[registers] = {};  // LED0_ON_L … as the chip has them
};

}  // namespace firmware
}  // namespace r4
