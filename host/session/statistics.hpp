// SPDX-License-Identifier: GPL-3.0-or-later
// How well the link does, seen from the host.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>

#include "../../protocol/link/packet_tracker.hpp"

namespace r4 {

struct Statistics {
  // Datagrams of the board
  std::uint64_t received = 0;  // valid ones
  std::uint64_t states = 0;
  std::uint64_t damaged = 0;  // bad checksum, syntax or length
  PacketCounters packets;     // lost, duplicate, late, restarts
  double state_rate_hz = 0;   // over the last second
  // Time, microseconds; 0 where nothing was measured yet
  double round_trip_us = 0;  // question to answer, the newest
  double round_trip_min_us = 0;
  double round_trip_mean_us = 0;
  double jitter_us = 0;     // interarrival jitter of the states (RFC 3550 6.4.1)
  double state_age_us = 0;  // since the newest state arrived
  // Datagrams of ours
  std::uint64_t heartbeats = 0;
  std::uint64_t commands = 0;  // retries not counted
  std::uint64_t retries = 0;
  std::uint64_t confirmed = 0;
  std::uint64_t refused = 0;
  std::uint64_t timed_out = 0;
  // Lost share of the board's datagrams, 0-1.
  double loss() const {
    const double all = static_cast<double>(received) + packets.lost;
    return all > 0 ? packets.lost / all : 0;
  }
};

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
