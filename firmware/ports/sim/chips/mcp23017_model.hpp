// SPDX-License-Identifier: GPL-3.0-or-later
// The MCP23017 by its data sheet (DS20001952), without interrupts (INTF and INTCAP read 0).
#pragma once

#include <cstdint>

#include "i2c_chip_model.hpp"

namespace r4 {
namespace sim {

class Mcp23017Model final : public I2cChipModel {
 public:
  enum class Register : std::uint8_t {
    iodir,
    ipol,
    gpinten,
    defval,
    intcon,
    iocon,
    gppu,
    intf,
    intcap,
    gpio,
    olat
  };
  static constexpr int ports = 2;  // 0: A, 1: B

  explicit Mcp23017Model(std::uint8_t address) : address_(address) {}

  std::uint8_t driven(int port) const;  // 1: the chip drives the pin
  std::uint8_t level(int port) const;   // level of driven pins; for other pins the outside level
  std::uint8_t reg(int port, Register number) const;
  void set_outside(int port, std::uint8_t levels);

  void power_on() override;
  bool start(std::uint8_t address, bool read) override;
  bool write(std::uint8_t byte) override;
  std::uint8_t read() override;

 private:
  static constexpr int registers = 11;
  bool bank() const { return (iocon_ & 0x80) != 0; }
  bool locate(int& port, Register& number) const;
  void next_register();

  std::uint8_t address_;
  std::uint8_t registers_[ports][registers] = {};
  std::uint8_t outside_[ports] = {};
  std::uint8_t iocon_ = 0;
  std::uint8_t pointer_ = 0;
  bool pointer_next_ = false;  // the next byte is the register's number
};

}  // namespace sim
}  // namespace r4
