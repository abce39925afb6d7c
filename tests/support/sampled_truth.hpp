// SPDX-License-Identifier: GPL-3.0-or-later
// Compares the sampling times that states report with the true times, over a real transport. The
// simulated board and the test use one clock, so the true time is known to some microseconds.
#pragma once

#include <cstddef>

#include "r4link/link.hpp"
#include "tests/support/board_in_a_thread.hpp"

namespace r4::test {

struct SampledTruth {
  std::size_t states = 0;     // states with a reported error
  std::size_t dishonest = 0;  // states whose true error was larger than the reported error
  ReceivedState::Clock::duration bound = ReceivedState::unknown;  // the last reported error
  // Errors of the last states, after the reported error was small enough.
  ReceivedState::Clock::duration median_error{}, worst_error{};
};

// Waits at most 10 s until the reported error is at most `enough`, then measures a hundred states.
// No other host may control the board.
SampledTruth look_at_sampled(BoardInAThread& simulated, const std::string& host_url,
                             ReceivedState::Clock::duration enough);

}  // namespace r4::test
