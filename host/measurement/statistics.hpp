// SPDX-License-Identifier: GPL-3.0-or-later
// Collects the counters and measurements of Statistics (link.hpp).
#pragma once

#include <array>
#include <chrono>
#include <cstdint>

#include "r4link/link.hpp"

namespace r4 {

// Each call takes constant time and no heap.
class StatisticsCollector {
 public:
  void on_state(std::uint32_t t_ms, std::chrono::microseconds now);
  void on_round_trip(std::chrono::microseconds duration);
  // Other parts of the session increment the plain counters directly.
  Statistics counts;

  Statistics report(std::chrono::microseconds now) const;

 private:
  struct Bucket {
    std::int64_t slot = 0;  // since the clock's start, in bucket widths
    std::uint32_t states = 0;
  };
  static constexpr int buckets = 10;  // of 100 ms: the last second
  std::array<Bucket, buckets> rate_;
  std::chrono::microseconds first_state_{0};
  std::chrono::microseconds last_state_{0};
  std::uint32_t last_t_ms_ = 0;
  std::uint64_t round_trips_ = 0;
};

}  // namespace r4
