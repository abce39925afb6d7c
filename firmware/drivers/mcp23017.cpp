// SPDX-License-Identifier: GPL-3.0-or-later
#include "mcp23017.hpp"

namespace r4 {
namespace firmware {

namespace {

constexpr std::uint8_t iodir_a = 0x00;
constexpr std::uint8_t iocon_if_bank_1 = 0x05;  // GPINTENB if BANK is 0: writing 0 is harmless
constexpr std::uint8_t iocon = 0x0A;
constexpr std::uint8_t olat_a = 0x14;

}  // namespace

Mcp23017::Mcp23017(I2cBus& bus, std::uint8_t address, std::uint16_t outputs, std::uint16_t safe)
    : ChipDriver(bus, address),
      inputs_{static_cast<std::uint8_t>(~outputs & 0xFF), static_cast<std::uint8_t>(~outputs >> 8)},
      safe_{static_cast<std::uint8_t>(safe & 0xFF), static_cast<std::uint8_t>(safe >> 8)},
      wanted_{safe_[0], safe_[1]} {}

void Mcp23017::set_ports(std::uint16_t ports) {
  wanted_[0] = static_cast<std::uint8_t>(ports & 0xFF);
  wanted_[1] = static_cast<std::uint8_t>(ports >> 8);
}

void Mcp23017::want_safe() {
  wanted_[0] = safe_[0];
  wanted_[1] = safe_[1];
}

I2cResult Mcp23017::make_safe() {
  want_safe();
  const std::uint8_t latches[] = {olat_a, safe_[0], safe_[1]};
  const I2cResult result = bus_.write(address(), latches, sizeof latches);
  if (result != I2cResult::ok) return result;
  written_[0] = safe_[0];
  written_[1] = safe_[1];
  const std::uint8_t directions[] = {iodir_a, inputs_[0], inputs_[1]};
  return bus_.write(address(), directions, sizeof directions);
}

void Mcp23017::on_begin() { step_ = Step::bank; }

bool Mcp23017::set_up(std::uint32_t now_us, BusBudget& budget) {
  static_cast<void>(now_us);
  switch (step_) {
    case Step::bank: {
      const std::uint8_t bytes[] = {iocon_if_bank_1, 0};
      if (!send(bytes, sizeof bytes, budget)) return false;
      step_ = Step::latches;
      return true;
    }
    case Step::latches: {
      const std::uint8_t bytes[] = {olat_a, safe_[0], safe_[1]};
      if (!send(bytes, sizeof bytes, budget)) return false;
      written_[0] = safe_[0];
      written_[1] = safe_[1];
      step_ = Step::directions;
      return true;
    }
    case Step::directions: {
      const std::uint8_t bytes[] = {iodir_a, inputs_[0], inputs_[1], 0, 0};  // then IPOL
      if (!send(bytes, sizeof bytes, budget)) return false;
      step_ = Step::mode;
      return true;
    }
    case Step::mode: {
      const std::uint8_t bytes[] = {iocon, 0};
      if (!send(bytes, sizeof bytes, budget)) return false;
      set_ready();
      return true;
    }
  }
  return false;
}

void Mcp23017::on_write_changes(BusBudget& budget) {
  const bool a = wanted_[0] != written_[0];
  const bool b = wanted_[1] != written_[1];
  if (!a && !b) return;
  const std::uint8_t first = a ? 0 : 1;
  const std::uint8_t end = b ? 2 : 1;
  std::uint8_t bytes[3] = {static_cast<std::uint8_t>(olat_a + first)};
  std::uint8_t size = 1;
  for (std::uint8_t i = first; i < end; ++i) bytes[size++] = wanted_[i];
  if (!send(bytes, size, budget)) return;
  for (std::uint8_t i = first; i < end; ++i) written_[i] = wanted_[i];
}

void Mcp23017::on_verify(BusBudget& budget) {
  if (budget.left() < 10) {
    budget.take(10);
    return;
  }
  std::uint8_t directions[2] = {};
  std::uint8_t latches[2] = {};
  if (!fetch(iodir_a, directions, sizeof directions, budget)) return;
  if (!fetch(olat_a, latches, sizeof latches, budget)) return;
  if (directions[0] != inputs_[0] || directions[1] != inputs_[1]) {
    fail(directions[0] == 0xFF && directions[1] == 0xFF ? ChipTrouble::was_reset
                                                        : ChipTrouble::wrong_register);
  } else if (latches[0] != written_[0] || latches[1] != written_[1]) {
    fail(ChipTrouble::wrong_register);
  }
}

}  // namespace firmware
}  // namespace r4
