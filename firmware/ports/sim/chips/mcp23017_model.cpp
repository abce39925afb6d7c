// SPDX-License-Identifier: GPL-3.0-or-later
#include "mcp23017_model.hpp"

namespace r4 {
namespace sim {

namespace {

using Register = Mcp23017Model::Register;

constexpr std::uint8_t byte_mode = 0x20;  // IOCON.SEQOP

constexpr int at(Register number) { return static_cast<int>(number); }

}  // namespace

void Mcp23017Model::power_on() {
  for (auto& port : registers_) {
    for (std::uint8_t& value : port) value = 0;
    port[at(Register::iodir)] = 0xFF;
  }
  iocon_ = 0;
  pointer_ = 0;
}

std::uint8_t Mcp23017Model::driven(int port) const {
  return static_cast<std::uint8_t>(~reg(port, Register::iodir));
}

std::uint8_t Mcp23017Model::level(int port) const {
  const std::uint8_t pulled_up = reg(port, Register::gppu);
  const std::uint8_t outside = outside_[port] | pulled_up;
  const std::uint8_t chip = driven(port);
  return static_cast<std::uint8_t>((reg(port, Register::olat) & chip) | (outside & ~chip));
}

std::uint8_t Mcp23017Model::reg(int port, Register number) const {
  if (number == Register::iocon) return iocon_;
  return registers_[port][at(number)];
}

void Mcp23017Model::set_outside(int port, std::uint8_t levels) { outside_[port] = levels; }

bool Mcp23017Model::start(std::uint8_t address, bool read) {
  pointer_next_ = !read;
  return address == address_;
}

bool Mcp23017Model::write(std::uint8_t byte) {
  if (pointer_next_) {
    pointer_ = byte;
    pointer_next_ = false;
    return true;
  }
  int port = 0;
  Register number = Register::iodir;
  if (locate(port, number)) {
    if (number == Register::iocon) {
      iocon_ = byte & 0xFE;
    } else if (number == Register::gpio) {  // a write to the port goes to its latch
      registers_[port][at(Register::olat)] = byte;
    } else if (number != Register::intf && number != Register::intcap) {
      registers_[port][at(number)] = byte;
    }
  }
  next_register();
  return true;
}

std::uint8_t Mcp23017Model::read() {
  int port = 0;
  Register number = Register::iodir;
  std::uint8_t value = 0;
  if (locate(port, number)) {
    value = reg(port, number);
    if (number == Register::gpio) {
      const std::uint8_t inverted =
          reg(port, Register::ipol) & static_cast<std::uint8_t>(~driven(port));
      value = level(port) ^ inverted;
    }
  }
  next_register();
  return value;
}

// Finds the port and register of the pointer; false if there is none. If BANK is set, port A has
// 00-0A and port B 10-1A, otherwise A and B alternate.
bool Mcp23017Model::locate(int& port, Register& number) const {
  const int index = bank() ? pointer_ & 0x0F : pointer_ / 2;
  port = bank() ? pointer_ >> 4 : pointer_ % 2;
  number = static_cast<Register>(index);
  return index < registers && port < ports;
}

void Mcp23017Model::next_register() {
  const bool sequential = (iocon_ & byte_mode) == 0;
  if (!sequential) {
    if (!bank()) pointer_ ^= 1;
    return;
  }
  ++pointer_;
  if (!bank() && pointer_ >= 2 * registers) pointer_ = 0;
  if (bank() && pointer_ == registers) pointer_ = 0x10;
  if (bank() && pointer_ >= 0x10 + registers) pointer_ = 0;
}

}  // namespace sim
}  // namespace r4
