// SPDX-License-Identifier: GPL-3.0-or-later
// Microchip MCP23017: up to sixteen outputs on two ports (data sheet DS20001952, IOCON.BANK = 0).
//     register       value                                        section
//     00 01 IODIR    1: input; reset FF                            3.5.1
//     02 03 IPOL     input polarity; reset 0                       3.5.2
//     04 05 GPINTEN  interrupt on change; reset 0                  3.5.3
//     0A 0B IOCON    BANK 80, SEQOP 20 …; reset 0                  3.5.6
//     14 15 OLAT     output latches; reset 0                       3.5.11
//
// Set-up: the latches with the safe values, then the directions, so that no pin is driven wrongly.
// Until then the pins float: each circuit needs a pull resistor to its safe level. Pins change at
// the acknowledge of their port's byte. Pins that are not outputs of the board stay inputs.
#pragma once

#include <cstdint>

#include "chip_driver.hpp"

namespace r4 {
namespace firmware {

class Mcp23017 final : public ChipDriver {
 public:
  // Bits 0-7 are port A, bits 8-15 port B.
  Mcp23017(I2cBus& bus, std::uint8_t address, std::uint16_t outputs, std::uint16_t safe);

  void set_ports(std::uint16_t ports);

  void want_safe() override;
  // Latches, then directions, because the chip may have been reset.
  I2cResult make_safe() override;

 private:
  enum class Step : std::uint8_t { bank, latches, directions, mode };

  void on_begin() override;
  bool set_up(std::uint32_t now_us, BusBudget& budget) override;
  void on_write_changes(BusBudget& budget) override;
  void on_verify(BusBudget& budget) override;

  std::uint8_t inputs_[2];
  std::uint8_t safe_[2];
  std::uint8_t wanted_[2];
  std::uint8_t written_[2] = {};
  Step step_ = Step::bank;
};

}  // namespace firmware
}  // namespace r4
