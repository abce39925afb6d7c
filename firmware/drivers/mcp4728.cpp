// SPDX-License-Identifier: GPL-3.0-or-later
#include "mcp4728.hpp"

namespace r4 {
namespace firmware {

namespace {

constexpr std::uint8_t multi_write = 0x40;       // | channel << 1; UDAC 0: output at once
constexpr std::uint8_t sequential_write = 0x50;  // from channel A, UDAC 0
constexpr std::uint8_t ready_bit = 0x80;         // RDY/BSY
constexpr std::uint8_t powered_bit = 0x40;       // POR

constexpr std::uint8_t zeros[] = {multi_write | 0, 0, 0, multi_write | 2, 0, 0,
                                  multi_write | 4, 0, 0, multi_write | 6, 0, 0};

bool is_ready(const std::uint8_t* bytes) { return (bytes[0] & ready_bit) != 0; }

// True if every channel in the EEPROM has the supply as reference, normal mode, gain 1, code 0.
bool eeprom_is_zero(const std::uint8_t* bytes) {
  for (int i = 0; i < Mcp4728::channels; ++i) {
    if (bytes[6 * i + 4] != 0 || bytes[6 * i + 5] != 0) return false;
  }
  return true;
}

}  // namespace

void Mcp4728::set_code(int channel, std::uint16_t code) {
  wanted_[channel] = code;
  if (code > code_max) wanted_[channel] = code_max;
}

void Mcp4728::want_safe() {
  for (std::uint16_t& code : wanted_) code = 0;
}

I2cResult Mcp4728::make_safe() {
  want_safe();
  const I2cResult result = bus_.write(address(), zeros, sizeof zeros);
  if (result == I2cResult::ok) {
    for (std::uint16_t& code : written_) code = 0;
  }
  return result;
}

void Mcp4728::on_begin() { step_ = Step::zero; }

bool Mcp4728::read_all(std::uint8_t (&bytes)[read_size], BusBudget& budget) {
  return usable() && budget.take(read_size + 1) &&
         note(bus_.write_read(address(), nullptr, 0, bytes, read_size));
}

bool Mcp4728::set_up(std::uint32_t now_us, BusBudget& budget) {
  std::uint8_t bytes[read_size] = {};
  switch (step_) {
    case Step::zero:
      if (!send(zeros, sizeof zeros, budget)) return false;
      for (std::uint16_t& code : written_) code = 0;
      since_us_ = now_us;
      looked_us_ = now_us;
      step_ = Step::look;
      return true;
    case Step::look: {
      if (budget.left() < read_size + 1 + 10) return budget.take(read_size + 11);
      if (!read_all(bytes, budget)) return false;
      if (!is_ready(bytes)) {  // a write from before this boot is under way
        looked_us_ = now_us;
        step_ = Step::wait;
        return true;
      }
      if (eeprom_is_zero(bytes)) {
        set_ready();
        return true;
      }
      if (eeprom_writes_ != 0) {  // the EEPROM failed: more writes wear it out
        fail(ChipTrouble::not_ready);
        return false;
      }
      const std::uint8_t provision[] = {sequential_write, 0, 0, 0, 0, 0, 0, 0, 0};
      if (!send(provision, sizeof provision, budget)) return false;
      ++eeprom_writes_;
      since_us_ = now_us;
      looked_us_ = now_us;
      step_ = Step::wait;
      return true;
    }
    case Step::wait:
      if (now_us - looked_us_ < eeprom_poll_us) return false;
      if (!read_all(bytes, budget)) return false;
      looked_us_ = now_us;
      if (is_ready(bytes)) {
        step_ = Step::zero;  // writes meanwhile were ignored
        return true;
      }
      if (now_us - since_us_ > eeprom_limit_us) fail(ChipTrouble::not_ready);
      return false;
  }
  return false;
}

void Mcp4728::on_write_changes(BusBudget& budget) {
  std::uint8_t bytes[3 * channels];
  std::uint8_t size = 0;
  for (std::uint8_t i = 0; i < channels; ++i) {
    if (wanted_[i] == written_[i]) continue;
    bytes[size++] = static_cast<std::uint8_t>(multi_write | i << 1);
    bytes[size++] = static_cast<std::uint8_t>(wanted_[i] >> 8);
    bytes[size++] = static_cast<std::uint8_t>(wanted_[i] & 0xFF);
  }
  if (size == 0 || !send(bytes, size, budget)) return;
  for (int i = 0; i < channels; ++i) written_[i] = wanted_[i];
}

void Mcp4728::on_verify(BusBudget& budget) {
  std::uint8_t bytes[read_size] = {};
  if (!read_all(bytes, budget)) return;
  if (!is_ready(bytes) || (bytes[0] & powered_bit) == 0) {
    fail(ChipTrouble::not_ready);
    return;
  }
  bool wrong = false;
  bool all_zero = true;
  for (int i = 0; i < channels; ++i) {
    const std::uint8_t* channel = bytes + 6 * i;
    wrong = wrong || channel[1] != written_[i] >> 8 || channel[2] != (written_[i] & 0xFF);
    all_zero = all_zero && channel[1] == 0 && channel[2] == 0;
  }
  if (wrong) fail(all_zero ? ChipTrouble::was_reset : ChipTrouble::wrong_register);
}

}  // namespace firmware
}  // namespace r4
