// SPDX-License-Identifier: GPL-3.0-or-later
#include "mcp4728_model.hpp"

namespace r4 {
namespace sim {

namespace {

constexpr std::uint8_t multi_write = 0b01000;
constexpr std::uint8_t sequential_write = 0b01010;
constexpr std::uint8_t single_write = 0b01011;

// The two bytes of a setting: VREF PD1 PD0 Gx D11-8, D7-0.
std::uint8_t high_byte(const Mcp4728Model::Setting& setting) {
  return static_cast<std::uint8_t>((setting.internal_reference ? 0x80 : 0) |
                                   setting.power_down << 5 | (setting.gain_2 ? 0x10 : 0) |
                                   setting.code >> 8);
}

Mcp4728Model::Setting setting_of(std::uint8_t high, std::uint8_t low) {
  Mcp4728Model::Setting setting;
  setting.internal_reference = (high & 0x80) != 0;
  setting.power_down = static_cast<std::uint8_t>(high >> 5 & 3);
  setting.gain_2 = (high & 0x10) != 0;
  setting.code = static_cast<std::uint16_t>((high & 0x0F) << 8 | low);
  return setting;
}

}  // namespace

Mcp4728Model::Mcp4728Model(std::uint8_t address, bool ldac_low)
    : address_(address), ldac_low_(ldac_low) {
  for (Setting& setting : eeprom_) setting.internal_reference = true;
  power_on();
}

std::int32_t Mcp4728Model::microvolts(int channel) const {
  const Setting& setting = output(channel);
  if (setting.power_down != 0) return 0;
  if (setting.internal_reference) return setting.code * (setting.gain_2 ? 1000 : 500);
  return static_cast<std::int32_t>(std::int64_t{5000000} * setting.code / 4096);
}

void Mcp4728Model::power_on() {
  for (int i = 0; i < channels; ++i) input_[i] = output_[i] = eeprom_[i];
  busy_until_ns_ = 0;
  size_ = 0;
}

bool Mcp4728Model::start(std::uint8_t address, bool read) {
  size_ = 0;
  has_command_ = false;
  channel_ = 0;
  read_at_ = 0;
  general_ = address == 0 && !read;
  ignoring_ = busy();
  return general_ || address == address_;
}

bool Mcp4728Model::write(std::uint8_t byte) {
  if (general_) return general_call(byte);
  if (ignoring_) return true;
  if (size_ == sizeof bytes_) return false;
  if (!has_command_) command_ = byte;
  has_command_ = true;
  bytes_[size_++] = byte;
  return command_complete();
}

bool Mcp4728Model::general_call(std::uint8_t byte) {
  if (busy()) return false;
  switch (byte) {
    case 0x06:
      power_on();
      return true;
    case 0x08:
      for (int i = 0; i < channels; ++i) show(i);
      return true;
    case 0x09:
      for (int i = 0; i < channels; ++i) {
        input_[i].power_down = 0;
        output_[i].power_down = 0;
      }
      return true;
    default:
      return false;
  }
}

// Handles the bytes received so far; false refuses the last byte. The transfer's first byte is the
// command; in repeated parts its bits have no meaning.
bool Mcp4728Model::command_complete() {
  const unsigned command = command_;
  if (command >> 6 == 0) {  // fast write: two bytes per channel, reference and gain stay
    if (size_ < 2) return true;
    Setting& input = input_[channel_ % channels];
    input.power_down = bytes_[0] >> 4 & 3;
    input.code = static_cast<std::uint16_t>((bytes_[0] & 0x0F) << 8 | bytes_[1]);
    if (ldac_low_) show(channel_ % channels);
    ++channel_;
    size_ = 0;
    return true;
  }
  const int selected = bytes_[0] >> 1 & 3;
  switch (command >> 3) {
    case multi_write:
      if (size_ < 3) return true;
      store(selected, (bytes_[0] & 1) == 0);
      size_ = 0;
      return true;
    case single_write:
      if (size_ < 3) return true;
      store(selected, (command & 1) == 0);
      write_eeprom(selected, selected + 1);
      ignoring_ = true;
      return true;
    case sequential_write:
      if (size_ == 1) {
        channel_ = first_channel_ = selected;
        return true;
      }
      if (size_ < 3) return true;
      if (channel_ == channels) return false;
      store(channel_, (command & 1) == 0);
      size_ = 1;
      if (++channel_ == channels) write_eeprom(first_channel_, channels);
      return true;
    default:
      break;
  }
  switch (command >> 5) {
    case 0b100:  // reference, gain: one bit per channel, A first
    case 0b110:
      for (int i = 0; i < channels; ++i) {
        const bool bit = (command >> (3 - i) & 1) != 0;
        (command >> 5 == 0b100 ? input_[i].internal_reference : input_[i].gain_2) = bit;
        show(i);
      }
      ignoring_ = true;
      return true;
    case 0b101: {  // power-down: 101x PDA PDB, PDC PDD xxxx
      if (size_ < 2) return true;
      const unsigned bits = (command & 0x0F) << 4 | bytes_[1] >> 4U;
      for (int i = 0; i < channels; ++i) {
        input_[i].power_down = static_cast<std::uint8_t>(bits >> (6 - 2 * i) & 3U);
        show(i);
      }
      ignoring_ = true;
      return true;
    }
    default:
      return false;  // writing the address bits needs the LDAC pin, which is fixed
  }
}

void Mcp4728Model::store(int channel, bool update) {
  input_[channel] = setting_of(bytes_[1], bytes_[2]);
  if (update || ldac_low_) show(channel);
}

void Mcp4728Model::write_eeprom(int first, int end) {
  ++eeprom_writes_;
  busy_until_ns_ = now_ns() + eeprom_write_us * 1000;
  for (int i = first; i < end && !worn_out_; ++i) eeprom_[i] = input_[i];
}

std::uint8_t Mcp4728Model::read() {
  const int channel = read_at_ / 6 % channels;
  const bool from_eeprom = read_at_ % 6 >= 3;
  const Setting& setting = from_eeprom ? eeprom_[channel] : input_[channel];
  const int part = read_at_++ % 3;
  if (part == 0) {
    return static_cast<std::uint8_t>((busy() ? 0 : 0x80) | 0x40 | channel << 4 | (address_ & 7));
  }
  return part == 1 ? high_byte(setting) : static_cast<std::uint8_t>(setting.code & 0xFF);
}

void Mcp4728Model::stop() { size_ = 0; }

}  // namespace sim
}  // namespace r4
