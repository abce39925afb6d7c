// SPDX-License-Identifier: GPL-3.0-or-later
// The steps that set a board's timeout and heartbeat interval: one setting at a time, with the
// interval below the timeout. No step is refused, for any present values of the board.
#pragma once

#include <chrono>
#include <cstdint>
#include <vector>

#include "r4link/text.hpp"

namespace r4 {

// The least values that a board accepts (protocol/messages/settings.hpp).
constexpr std::uint32_t least_heartbeat_ms = 50;
constexpr std::uint32_t least_timeout_ms = 100;

struct LinkTimingStep {
  Text key;
  std::uint32_t ms;
};

inline std::vector<LinkTimingStep> link_timing_steps(std::chrono::milliseconds timeout,
                                                     std::chrono::milliseconds heartbeat) {
  const auto timeout_ms = static_cast<std::uint32_t>(timeout.count());
  const auto heartbeat_ms = static_cast<std::uint32_t>(heartbeat.count());
  const std::uint32_t first_ms =
      heartbeat_ms < least_timeout_ms ? heartbeat_ms : least_heartbeat_ms;
  std::vector<LinkTimingStep> steps{{Text("heartbeat"), first_ms}, {Text("timeout"), timeout_ms}};
  if (first_ms != heartbeat_ms) steps.push_back({Text("heartbeat"), heartbeat_ms});
  return steps;
}

}  // namespace r4
