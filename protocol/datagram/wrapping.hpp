// SPDX-License-Identifier: GPL-3.0-or-later
// Comparisons of 32-bit numbers and times that wrap (serial-number arithmetic, RFC 1982).
//
// They are right for two values that are less than 2^31 apart: 24.8 days of milliseconds, 35
// minutes of microseconds. A time that is kept for longer has to be moved along by keep_near().
#pragma once

#include <cstdint>

namespace r4 {

// True if `a` is newer than `b`: half of all numbers are ahead of any number, half are behind.
constexpr bool newer(std::uint32_t a, std::uint32_t b) {
  return static_cast<std::int32_t>(a - b) > 0;
}

// True if the time `at` has come.
constexpr bool reached(std::uint32_t now, std::uint32_t at) {
  return static_cast<std::int32_t>(now - at) >= 0;
}

// A time in the past that is farther back than this is "long ago", however long ago it was.
constexpr std::uint32_t long_ago = std::uint32_t{1} << 30;

// Moves a past time along, so that comparisons with it stay right. To be called more often than
// every 12 days.
// A time that is still to come stays as it is.
inline void keep_near(std::uint32_t& past, std::uint32_t now) {
  if (newer(now - long_ago, past)) past = now - long_ago;
}

}  // namespace r4
