// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/sampled_truth.hpp"

#include <algorithm>
#include <chrono>
#include <vector>

#include "r4link/board.hpp"

namespace r4::test {
namespace {

using Clock = ReceivedState::Clock;
using namespace std::chrono_literals;

// The time at which the board's clock began to show t_ms. This time may be `width` too late.
struct ClockEdge {
  std::uint32_t t_ms = 0;
  Clock::time_point at;
  Clock::duration width = Clock::duration::max();
};

ClockEdge edge_of(BoardInAThread& simulated) {
  ClockEdge best;
  simulated.run([&best](sim::SimulatedBoard& board) {
    for (int tries = 0; tries < 100 && best.width > 10us; ++tries) {
      Clock::time_point from, next = Clock::now();
      const std::uint32_t before = board.now_ms();
      std::uint32_t shown = before;
      while (shown == before) {
        from = next;  // before the last reading that showed no change
        next = Clock::now();
        shown = board.now_ms();
      }
      const Clock::time_point to = Clock::now();
      if (to - from < best.width) best = {shown, to, to - from};
    }
  });
  return best;
}

}  // namespace

SampledTruth look_at_sampled(BoardInAThread& simulated, const std::string& host_url,
                             Clock::duration enough) {
  const ClockEdge edge = edge_of(simulated);
  Board board(host_url);
  board.wait_active();
  SampledTruth found;
  std::vector<Clock::duration> errors;
  const auto deadline = Clock::now() + 10s;
  while (errors.size() < 100) {
    const ReceivedState state = board.next_state();
    if (state.sampled_error == ReceivedState::unknown) continue;
    const std::chrono::milliseconds later{static_cast<std::int32_t>(state.t_ms - edge.t_ms)};
    const Clock::duration error = std::chrono::abs(state.sampled - (edge.at + later));
    ++found.states;
    found.dishonest += error > state.sampled_error + edge.width;
    found.bound = state.sampled_error;
    if (!errors.empty() || found.bound <= enough || Clock::now() > deadline)
      errors.push_back(error);
  }
  std::sort(errors.begin(), errors.end());
  found.median_error = errors[errors.size() / 2];
  found.worst_error = errors.back();
  return found;
}

}  // namespace r4::test
