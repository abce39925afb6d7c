// SPDX-License-Identifier: GPL-3.0-or-later
// In which order a board's timeout and heartbeat interval are set, so that none of the steps is refused
// whatever they are now: the board takes each setting by itself, and an interval only below the timeout.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>

#include "r4link/text.hpp"

namespace r4 {

// The least that a board takes (protocol/messages/settings.hpp).
constexpr std::uint32_t least_heartbeat_ms = 50;
constexpr std::uint32_t least_timeout_ms = 100;

struct LinkTimingStep {
  Text key;
  std::uint32_t ms;
};

struct LinkTimingSteps {
  LinkTimingStep step[3];
  std::size_t count;
  const LinkTimingStep& operator[](std::size_t i) const { return step[i]; }
};

// First an interval that is below any timeout, then the timeout, then the interval that is wanted, if it
// is another.
inline LinkTimingSteps link_timing_steps(std::chrono::milliseconds timeout,
                                         std::chrono::milliseconds heartbeat) {
  const auto timeout_ms = static_cast<std::uint32_t>(timeout.count());
  const auto heartbeat_ms = static_cast<std::uint32_t>(heartbeat.count());
  if (heartbeat_ms < least_timeout_ms) {
    return {{{Text("heartbeat"), heartbeat_ms}, {Text("timeout"), timeout_ms}, {}}, 2};
  }
  return {{{Text("heartbeat"), least_heartbeat_ms},
           {Text("timeout"), timeout_ms},
           {Text("heartbeat"), heartbeat_ms}},
          3};
}

}  // namespace r4
