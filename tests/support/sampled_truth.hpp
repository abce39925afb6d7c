// SPDX-License-Identifier: GPL-3.0-or-later
// Whether states tell truly when they were sampled, over a real transport: the simulated board's clock is this
// machine's, so that the truth is known to some microseconds.
#pragma once

#include <cstddef>

#include "r4link/link.hpp"
#include "tests/support/board_in_a_thread.hpp"

namespace r4::test {

struct SampledTruth {
  std::size_t states = 0;     // whose error was told
  std::size_t dishonest = 0;  // of them those that were farther from the truth
  ReceivedState::Clock::duration bound = ReceivedState::unknown;  // the last one told
  // Of the last states, from which the bound was good enough.
  ReceivedState::Clock::duration median_error{}, worst_error{};
};

// Listens until the error that is told is `enough`, 10 s at most, and then to a hundred states more. No host has the
// board yet.
SampledTruth look_at_sampled(BoardInAThread& simulated, const std::string& host_url,
                             ReceivedState::Clock::duration enough);

}  // namespace r4::test
