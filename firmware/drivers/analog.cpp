// SPDX-License-Identifier: GPL-3.0-or-later
#include "analog.hpp"

namespace r4 {
namespace firmware {

namespace {

// Rounds to the nearest, also for negative values.
std::int64_t shifted(std::int64_t value, int shift) {
  const std::int64_t half = std::int64_t{1} << (shift - 1);
  const std::int64_t unit = std::int64_t{1} << shift;
  return (value >= 0 ? value + half : value - half) / unit;
}

constexpr std::int64_t gain_max = 0x3FFFFFFF;
constexpr std::int64_t offset_max = 0x3FFFFFFF;

}  // namespace

bool AnalogCalibration::set(std::uint16_t counts_1, std::int32_t centivolts_1,
                            std::uint16_t counts_2, std::int32_t centivolts_2) {
  const std::int64_t counts = std::int64_t{counts_2} - counts_1;
  const std::int64_t volts = std::int64_t{centivolts_2} - centivolts_1;
  if (counts == 0 || (counts > 0) != (volts > 0) || volts == 0) return false;
  const std::int64_t gain = volts * (std::int64_t{1} << 24) / counts;
  const std::int64_t offset = std::int64_t{centivolts_1} * 256 - shifted(gain * counts_1, 16);
  if (gain > gain_max || offset > offset_max || offset < -offset_max) return false;
  gain_q24 = static_cast<std::int32_t>(gain);
  offset_q8 = static_cast<std::int32_t>(offset);
  return true;
}

std::int32_t centivolts_of(std::uint16_t counts, const AnalogCalibration& calibration) {
  const std::int64_t value =
      std::int64_t{counts} * calibration.gain_q24 + std::int64_t{calibration.offset_q8} * 65536;
  return static_cast<std::int32_t>(shifted(value, 24));
}

}  // namespace firmware
}  // namespace r4
