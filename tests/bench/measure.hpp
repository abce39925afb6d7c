// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <benchmark/benchmark.h>

#include <cstddef>
#include <cstdint>

#include "tests/bench/allocations.hpp"

namespace r4::bench {

// Times `work` on `size` bytes and reports its allocations as "allocs".
template <class Work>
void measure(benchmark::State& bench, std::size_t size, Work work) {
  bench.counters["allocs"] = allocations_per_call(work);
  for (auto _ : bench) {
    work();
    benchmark::ClobberMemory();
  }
  bench.SetBytesProcessed(bench.iterations() * static_cast<std::int64_t>(size));
}

}  // namespace r4::bench
