// SPDX-License-Identifier: GPL-3.0-or-later
// Gathers how well the link does.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>

#include "r4link/link.hpp"

namespace r4 {

// Gathers what Statistics reports. Constant time and no heap.
class StatisticsCollector {
 public:
  void on_state(std::uint32_t t_ms, std::chrono::microseconds now);
  void on_round_trip(std::chrono::microseconds duration);
  // The counters that need no arithmetic are counted directly.
  Statistics counts;

  // `counts` with everything that depends on `now`.
  Statistics report(std::chrono::microseconds now) const;

 private:
  static constexpr int buckets = 10;  // of 100 ms: the last second
  void advance(std::int64_t slot) const;
  mutable std::array<std::uint32_t, buckets> rate_{};
  mutable std::int64_t newest_slot_ = 0;
  std::chrono::microseconds first_state_{0};
  std::chrono::microseconds last_state_{0};
  std::uint32_t last_t_ms_ = 0;
  bool any_state_ = false;
  double jitter_us_ = 0;
  std::uint64_t round_trips_ = 0;
};

}  // namespace r4
