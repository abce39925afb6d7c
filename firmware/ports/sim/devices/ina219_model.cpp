// SPDX-License-Identifier: GPL-3.0-or-later
#include "ina219_model.hpp"

namespace r4 {
namespace sim {

namespace {

enum Register : std::uint8_t { configuration, shunt, bus, power, current, calibration };
constexpr std::uint16_t reset_bit = 0x8000;
constexpr std::uint16_t conversion_ready = 2;

}  // namespace

void Ina219Model::power_on() {
  configuration_ = 0x399F;
  calibration_ = 0;
  pointer_ = 0;
}

bool Ina219Model::start(std::uint8_t to, bool) {
  byte_ = 0;
  return to == address;
}

bool Ina219Model::write(std::uint8_t byte) {
  const std::uint8_t at = byte_;
  if (byte_ != 2) ++byte_;
  if (at == 0) {
    pointer_ = byte;
  } else if (at == 1) {
    high_ = byte;
  } else {
    const auto value = static_cast<std::uint16_t>(high_ << 8 | byte);
    byte_ = 1;
    if (pointer_ == configuration) {
      if ((value & reset_bit) != 0) {
        power_on();
      } else {
        configuration_ = value;
      }
    } else if (pointer_ == calibration) {
      calibration_ = value & 0xFFFEU;  // bit 0 cannot be set
    }
  }
  return true;
}

std::uint8_t Ina219Model::read() {
  const bool higher = byte_ == 0;
  byte_ = higher ? 1 : 0;
  if (higher) latched_ = value_of(pointer_);
  return static_cast<std::uint8_t>(higher ? latched_ >> 8 : latched_);
}

std::uint16_t Ina219Model::value_of(std::uint8_t at) const {
  constexpr std::int32_t shunt_lsb_uv = 10;
  constexpr std::int32_t bus_lsb_mv = 4;
  constexpr std::int32_t shunt_end = 32000;  // 320 mV in the power-on configuration
  const std::int32_t shunt_read = shunt_uv_ / shunt_lsb_uv;
  const std::int32_t shunt_value = shunt_read > shunt_end    ? shunt_end
                                   : shunt_read < -shunt_end ? -shunt_end
                                                             : shunt_read;
  const std::int32_t bus_value = bus_mv_ / bus_lsb_mv;
  const std::int32_t current_value = shunt_value * calibration_ / 4096;
  switch (at) {
    case configuration:
      return configuration_;
    case shunt:
      return static_cast<std::uint16_t>(shunt_value);
    case bus:
      return static_cast<std::uint16_t>(bus_value << 3 | conversion_ready);
    case power:
      return static_cast<std::uint16_t>(current_value * bus_value / 5000);
    case current:
      return static_cast<std::uint16_t>(current_value);
    case calibration:
      return calibration_;
    default:
      return 0;
  }
}

}  // namespace sim
}  // namespace r4
