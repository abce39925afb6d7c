// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/devices/description.hpp"

#include <algorithm>
#include <cmath>

#include "description_parser.hpp"

namespace r4 {

const char* to_text(DeviceRole role) {
  switch (role) {
    case DeviceRole::none:
      return "none";
    case DeviceRole::imu:
      return "imu";
    case DeviceRole::power:
      return "power";
    case DeviceRole::range:
      return "range";
    case DeviceRole::angle:
      return "angle";
  }
  return "unknown";
}

std::optional<double> DeviceValue::decode(const std::uint8_t* bytes, std::size_t count) const {
  if (static_cast<std::size_t>(at) + static_cast<std::size_t>(size) > count) return std::nullopt;
  std::uint32_t raw = 0;
  for (int i = 0; i < size; ++i) raw = raw << 8 | bytes[big_endian ? at + i : at + size - 1 - i];
  // Shifts left and then right, to fill in the sign or zeros.
  raw <<= 31 - high_bit;
  const int down = 31 - high_bit + low_bit;
  const double read = is_signed ? static_cast<double>(static_cast<std::int32_t>(raw) >> down)
                                : static_cast<double>(raw >> down);
  const double number = read * scale + offset;
  if (!std::isfinite(number) || number < minimum || number > maximum) return std::nullopt;
  return number;
}

std::optional<std::size_t> DeviceDescription::find(std::string_view value) const {
  const auto found = std::find_if(values.begin(), values.end(),
                                  [value](const DeviceValue& each) { return each.name == value; });
  if (found == values.end()) return std::nullopt;
  return static_cast<std::size_t>(found - values.begin());
}

DeviceDescription DeviceDescription::parse(std::string_view text, const std::string& source) {
  DeviceDescription description = DescriptionParser(source).parse(text);
  description.text = text;
  return description;
}

}  // namespace r4
