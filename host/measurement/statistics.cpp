// SPDX-License-Identifier: GPL-3.0-or-later
#include "statistics.hpp"

#include <algorithm>
#include <cmath>

namespace r4 {

namespace {

constexpr std::chrono::microseconds bucket_width{100'000};

}  // namespace

// Empties the buckets that time has run past.
void StatisticsCollector::advance(std::int64_t slot) const {
  const std::int64_t steps = std::min<std::int64_t>(slot - newest_slot_, buckets);
  for (std::int64_t i = 1; i <= steps; ++i) {
    rate_[static_cast<std::size_t>((newest_slot_ + i) % buckets)] = 0;
  }
  newest_slot_ = std::max(newest_slot_, slot);
}

void StatisticsCollector::on_state(std::uint32_t t_ms, std::chrono::microseconds now) {
  ++counts.states;
  const std::int64_t slot = now / bucket_width;
  if (!any_state_) {
    newest_slot_ = slot;
    first_state_ = now;
  }
  advance(slot);
  ++rate_[static_cast<std::size_t>(slot % buckets)];
  if (any_state_ && t_ms != last_t_ms_) {
    const double sent_us = static_cast<double>(static_cast<std::int32_t>(t_ms - last_t_ms_)) * 1000;
    const double came_us = static_cast<double>((now - last_state_).count());
    jitter_us_ += (std::abs(came_us - sent_us) - jitter_us_) / 16;
  }
  last_t_ms_ = t_ms;
  last_state_ = now;
  any_state_ = true;
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
  report.jitter_us = jitter_us_;
  if (!any_state_) return report;
  advance(now / bucket_width);
  std::uint64_t in_window = 0;
  for (const std::uint32_t count : rate_) in_window += count;
  // The window ends now and reaches back over nine whole buckets and the part of the newest.
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
