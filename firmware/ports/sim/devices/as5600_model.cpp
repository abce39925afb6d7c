// SPDX-License-Identifier: GPL-3.0-or-later
#include "as5600_model.hpp"

namespace r4 {
namespace sim {

namespace {

constexpr int as_zpos = 0x01;
constexpr int as_mpos = 0x03;
constexpr int as_mang = 0x05;
constexpr int as_status = 0x0B;
constexpr int as_raw_angle = 0x0C;
constexpr int as_angle = 0x0E;
constexpr int as_agc = 0x1A;
constexpr int as_magnitude = 0x1B;
constexpr std::uint8_t as_detected = 0x20;
constexpr std::uint8_t as_too_weak = 0x10;
constexpr std::uint8_t as_too_strong = 0x08;
constexpr std::uint16_t as_field = 0x0800;

std::uint8_t byte_of(std::uint16_t word, int offset) {
  return static_cast<std::uint8_t>(offset == 0 ? word >> 8 : word);
}

}  // namespace

void As5600Model::power_on() {
  for (std::uint8_t& each : settings_) each = 0;
}

std::uint8_t As5600Model::after(std::uint8_t at) const {
  const bool lower = at == as_raw_angle + 1 || at == as_angle + 1 || at == as_magnitude + 1;
  return static_cast<std::uint8_t>(lower ? at - 1 : at + 1);
}

std::uint16_t As5600Model::setting(int at) const {
  return static_cast<std::uint16_t>((settings_[at] << 8 | settings_[at + 1]) & 0xFFF);
}

// The angle from ZPOS on, scaled to the range of MPOS or MANG.
std::uint16_t As5600Model::output() const {
  const int turned = (latched_ - setting(as_zpos)) & 0xFFF;
  int all = setting(as_mang);
  if (setting(as_mpos) != 0) all = (setting(as_mpos) - setting(as_zpos)) & 0xFFF;
  if (all == 0) return static_cast<std::uint16_t>(turned);
  return static_cast<std::uint16_t>(turned >= all ? 0xFFF : turned * 0x1000 / all);
}

std::uint8_t As5600Model::read_register(std::uint8_t at) {
  if (at < setting_count) return settings_[at];
  const bool there = magnet_ != Magnet::missing;
  switch (at) {
    case as_status:
      return static_cast<std::uint8_t>((there ? as_detected : 0) |
                                       (magnet_ == Magnet::too_weak || !there ? as_too_weak : 0) |
                                       (magnet_ == Magnet::too_strong ? as_too_strong : 0));
    case as_raw_angle:
    case as_raw_angle + 1:
      return byte_of(latched_, at - as_raw_angle);
    case as_angle:
    case as_angle + 1:
      return byte_of(output(), at - as_angle);
    case as_agc:
      // At 3.3 V the highest value is 128.
      return magnet_ == Magnet::too_strong ? 0 : magnet_ == Magnet::right ? 0x40 : 0x80;
    case as_magnitude:
    case as_magnitude + 1:
      return byte_of(there ? as_field : 0, at - as_magnitude);
    default:
      return 0;
  }
}

void As5600Model::write_register(std::uint8_t at, std::uint8_t byte) {
  if (at >= as_zpos && at < setting_count) settings_[at] = byte;
}

}  // namespace sim
}  // namespace r4
