// SPDX-License-Identifier: GPL-3.0-or-later
// Microchip MCP4728: four 12-bit voltage outputs A-D with power-on values in EEPROM (data sheet
// DS22187). Used with the supply, 5 V, as reference: code / 4096 x 5 V.
//     command              bytes                                                   section
//     multi-write          01000 ch1 ch0 UDAC | VREF PD1 PD0 Gx D11-8 | D7-0, …    5.6.2
//     sequential write     01010 ch1 ch0 UDAC, then 2 bytes a channel up to D;     5.6.3
//                          also to the EEPROM, which takes up to 50 ms
//     read                 24 bytes: for each channel RDY POR ch1 ch0 0 A2-0 and   5.7
//                          two bytes of the input register, then the same of the
//                          EEPROM
//
// Only multi-writes with UDAC = 0 are used, so the output changes even if the LDAC pin is not wired
// low. Each write has reference, power-down and gain, so a changed channel is right even after an
// unnoticed reset. The fast write is a third shorter, but depends on LDAC and the registers.
// Set-up: zeros to all outputs. If the EEPROM does not hold zeros with the supply as reference, as
// in a new chip, it is written once. Meanwhile the chip ignores other writes.
#pragma once

#include <cstdint>

#include "chip_driver.hpp"

namespace r4 {
namespace firmware {

class Mcp4728 final : public ChipDriver {
 public:
  static constexpr int channels = 4;
  static constexpr std::uint16_t code_max = 4095;
  static constexpr std::uint32_t eeprom_poll_us = 5000;
  static constexpr std::uint32_t eeprom_limit_us = 100000;

  Mcp4728(I2cBus& bus, std::uint8_t address) : ChipDriver(bus, address) {}

  // Takes effect at the next write. Channels 0-3 are A-D; codes above 4095 become 4095.
  void set_code(int channel, std::uint16_t code);
  // Since power-up: 0 or 1.
  int eeprom_writes() const { return eeprom_writes_; }

  void want_safe() override;
  I2cResult make_safe() override;

 private:
  static constexpr int read_size = 24;
  enum class Step : std::uint8_t { zero, look, wait };

  void on_begin() override;
  bool set_up(std::uint32_t now_us, BusBudget& budget) override;
  void on_write_changes(BusBudget& budget) override;
  void on_verify(BusBudget& budget) override;
  bool read_all(std::uint8_t (&bytes)[read_size], BusBudget& budget);

  Step step_ = Step::zero;
  std::uint32_t since_us_ = 0;   // when the EEPROM's write began
  std::uint32_t looked_us_ = 0;  // when the step began, or the chip was last read
  int eeprom_writes_ = 0;
  std::uint16_t wanted_[channels] = {};
  std::uint16_t written_[channels] = {};
};

}  // namespace firmware
}  // namespace r4
