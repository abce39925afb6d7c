// SPDX-License-Identifier: GPL-3.0-or-later
// From the converter's counts to volts at the board's input: a divider set by a potentiometer lies
// between, so each input has a calibration (paper sections 2 and 8.5).
//
// volts = counts x gain + offset, in integers: the result is within one hundredth of a volt of the
// exact line for counts of 0-65535 and up to 50 V.
#pragma once

#include <cstdint>

namespace r4 {
namespace firmware {

struct AnalogCalibration {
  std::int32_t gain_q24 = 1280019;  // hundredths of a volt a count, times 2^24: 50.00 V at 65535
  std::int32_t offset_q8 = 0;       // hundredths of a volt, times 256

  // The line through two readings. False, and nothing changed, if it is none that a divider can
  // have: no distance, falling, or steeper than 650 V of full range.
  bool set(std::uint16_t counts_1, std::int32_t centivolts_1, std::uint16_t counts_2,
           std::int32_t centivolts_2);
};

// Hundredths of a volt, to the nearest.
std::int32_t centivolts_of(std::uint16_t counts, const AnalogCalibration& calibration);

}  // namespace firmware
}  // namespace r4
