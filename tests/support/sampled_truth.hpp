// SPDX-License-Identifier: GPL-3.0-or-later
// Compares the reported sampling times of states with the true ones, over a real transport: the
// simulated board's clock is this computer's, so the true time is known to some microseconds.
#pragma once

#include <cstddef>

#include "r4link/link.hpp"
#include "tests/support/board_in_a_thread.hpp"

namespace r4::test {

struct SampledTruth {
  std::size_t states = 0;     // with a reported error
  std::size_t dishonest = 0;  // of these, states whose error was larger than reported
  ReceivedState::Clock::duration bound = ReceivedState::unknown;  // the last reported error
  // Of the last states, since the reported error was small enough.
  ReceivedState::Clock::duration median_error{}, worst_error{};
};

// Waits until the reported error is at most `enough`, 10 s at most, and then measures a hundred
// states. No other host may control the board.
SampledTruth look_at_sampled(BoardInAThread& simulated, const std::string& host_url,
                             ReceivedState::Clock::duration enough);

}  // namespace r4::test
