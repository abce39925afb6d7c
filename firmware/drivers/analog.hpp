// SPDX-License-Identifier: GPL-3.0-or-later
// Volts at the board's input: counts x gain + offset, calibrated for each input's divider (paper
// sections 2 and 8.5). Within 0.01 V of the exact line for counts of 0-65535 and up to 50 V.
#pragma once

#include <cstdint>

namespace r4 {
namespace firmware {

struct AnalogCalibration {
  std::int32_t gain_q24 = 1280019;  // hundredths of a volt per count, times 2^24: 50.00 V at 65535
  std::int32_t offset_q8 = 0;       // hundredths of a volt, times 256

  // The line through two readings. Returns false and changes nothing for equal counts or volts, a
  // falling line, or a gain or offset above about 42 kV of full range: no divider has such a line.
  bool set(std::uint16_t counts_1, std::int32_t centivolts_1, std::uint16_t counts_2,
           std::int32_t centivolts_2);
};

std::int32_t centivolts_of(std::uint16_t counts, const AnalogCalibration& calibration);

}  // namespace firmware
}  // namespace r4
