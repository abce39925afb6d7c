// SPDX-License-Identifier: GPL-3.0-or-later
// Converts the host's time (r4::Time) to the wrapping milliseconds of protocol/. Limits timeouts.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

#include "r4link/link.hpp"

namespace r4 {

inline std::uint32_t to_ms(Time time) {
  return static_cast<std::uint32_t>(
      std::chrono::duration_cast<std::chrono::milliseconds>(time).count());
}

// At most a day, so that sums cannot overflow.
inline std::chrono::milliseconds bounded(std::chrono::milliseconds timeout) {
  return std::clamp<std::chrono::milliseconds>(timeout, {}, std::chrono::hours{24});
}

}  // namespace r4
