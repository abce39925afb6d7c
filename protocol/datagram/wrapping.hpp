// SPDX-License-Identifier: GPL-3.0-or-later
// Comparisons of 32-bit numbers and times that wrap (RFC 1982): right for values less than 2^31
// apart, 24.8 days in ms, 35 minutes in us. A time that is kept for longer needs keep_near().
#pragma once

#include <cstdint>

namespace r4 {

constexpr bool newer(std::uint32_t a, std::uint32_t b) {
  return static_cast<std::int32_t>(a - b) > 0;
}

constexpr bool reached(std::uint32_t now, std::uint32_t at) {
  return static_cast<std::int32_t>(now - at) >= 0;
}

constexpr std::uint32_t long_ago = std::uint32_t{1} << 30;

// Keeps past times within long_ago of `now`: comparisons stay right. Call at least every 12 days.
inline void keep_near(std::uint32_t& past, std::uint32_t now) {
  if (newer(now - long_ago, past)) past = now - long_ago;
}

}  // namespace r4
