// SPDX-License-Identifier: GPL-3.0-or-later
// Counts the calls of the global operator new, for benchmarks and for tests of functions that must
// not allocate.
#pragma once

#include <cstdint>

namespace r4::bench {

// Calls of operator new in this process so far, by all threads.
std::uint64_t allocations();
std::uint64_t allocations_of_this_thread();

// The average number of calls of operator new during one call of `work`.
template <class Work>
double allocations_per_call(Work work) {
  constexpr int calls = 1000;
  const std::uint64_t before = allocations();
  for (int i = 0; i < calls; ++i) work();
  return static_cast<double>(allocations() - before) / calls;
}

}  // namespace r4::bench
