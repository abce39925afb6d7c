// SPDX-License-Identifier: GPL-3.0-or-later
// Counts what goes through the global operator new, for benchmarks and tests of what promises to
// allocate nothing.
#pragma once

#include <cstdint>

namespace r4::bench {

// Calls of operator new in this process so far, all threads.
std::uint64_t allocations();
// Those of the thread that asks.
std::uint64_t allocations_of_this_thread();

// How many of them a call of `work` costs, on average.
template <class Work>
double allocations_per_call(Work work) {
  constexpr int calls = 1000;
  const std::uint64_t before = allocations();
  for (int i = 0; i < calls; ++i) work();
  return static_cast<double>(allocations() - before) / calls;
}

}  // namespace r4::bench
