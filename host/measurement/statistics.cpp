// SPDX-License-Identifier: GPL-3.0-or-later
#include "statistics.hpp"

#include <algorithm>
#include <cmath>

namespace r4 {

namespace {

constexpr std::chrono::microseconds bucket_width{100'000};

}  // namespace

void StatisticsCollector::on_state(std::uint32_t t_ms, std::chrono::microseconds now) {
  const std::int64_t slot = now / bucket_width;
  if (counts.states == 0) {
    first_state_ = now;
  } else if (t_ms != last_t_ms_) {
    const double sent_us = static_cast<double>(static_cast<std::int32_t>(t_ms - last_t_ms_)) * 1000;
    const double came_us = static_cast<double>((now - last_state_).count());
    counts.jitter_us += (std::abs(came_us - sent_us) - counts.jitter_us) / 16;
  }
  ++counts.states;
  Bucket& bucket = rate_[static_cast<std::size_t>(slot % buckets)];
  if (bucket.slot != slot) bucket = {slot, 0};
  ++bucket.states;
  last_t_ms_ = t_ms;
  last_state_ = now;
}

void StatisticsCollector::on_round_trip(std::chrono::microseconds duration) {
  const double us = static_cast<double>(duration.count());
  counts.round_trip_us = us;
  counts.round_trip_min_us = round_trips_ == 0 ? us : std::min(counts.round_trip_min_us, us);
  ++round_trips_;
  counts.round_trip_mean_us += (us - counts.round_trip_mean_us) / static_cast<double>(round_trips_);
}

Statistics StatisticsCollector::report(std::chrono::microseconds now) const {
  Statistics report = counts;
  if (report.states == 0) return report;
  std::uint64_t in_window = 0;
  for (const Bucket& each : rate_) {
    if (each.slot > now / bucket_width - buckets) in_window += each.states;
  }
  // The window covers nine whole buckets and a part of the newest bucket.
  const auto window =
      std::min((buckets - 1) * bucket_width + now % bucket_width, now - first_state_);
  if (window.count() > 0) {
    report.state_rate_hz =
        static_cast<double>(in_window) * 1e6 / static_cast<double>(window.count());
  }
  report.state_age_us = static_cast<double>((now - last_state_).count());
  return report;
}

}  // namespace r4
