// SPDX-License-Identifier: GPL-3.0-or-later
// The host's time.
#pragma once

#include <chrono>
#include <cstdint>

namespace r4 {

// Time of the host's steady clock; any start.
using Time = std::chrono::microseconds;

// The same for the machines of protocol/, whose milliseconds wrap.
inline std::uint32_t to_ms(Time time) {
  return static_cast<std::uint32_t>(
      std::chrono::duration_cast<std::chrono::milliseconds>(time).count());
}

}  // namespace r4
