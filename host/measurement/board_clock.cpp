// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_clock.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace r4 {

// Microseconds since the first datagram. Datagrams overtake: t_ms may be older than the newest T.
double BoardClock::since_first(std::uint32_t t_ms) const {
  const auto later = static_cast<std::int32_t>(t_ms - newest_t_ms_);
  return static_cast<double>(newest_board_ms_ + later) * 1000;
}

void BoardClock::limit(Side& side, std::uint32_t t_ms, Time host, Time margin) {
  if (!any_) {
    any_ = true;
    newest_t_ms_ = t_ms;
    first_ = host;
  }
  const auto later = static_cast<std::int32_t>(t_ms - newest_t_ms_);
  if (later > 0) {
    newest_board_ms_ += later;
    newest_t_ms_ = t_ms;
  }
  if (place(side, t_ms, host, margin)) return;
  // No drift up to 100 ppm fits: a clock was set or paused (sleep). Only the newest limit is kept.
  restart();
  limit(side, t_ms, host, margin);
}

// False if the limit contradicts the earlier limits.
bool BoardClock::place(Side& side, std::uint32_t t_ms, Time host, Time margin) {
  Limit fresh;
  fresh.at = since_first(t_ms);
  fresh.second = static_cast<std::int64_t>(std::floor(fresh.at / 1e6));
  fresh.offset = static_cast<double>((host - first_ + margin).count()) - fresh.at;
  if (!is_upper(side)) fresh.offset = -fresh.offset;
  if (is_old(fresh.second)) return false;  // no datagram is delayed for a minute
  if (fresh.offset < -highest(is_upper(side) ? lower_ : upper_, fresh.at)) return false;
  if (fresh.second > newest_second_) next_second(fresh.second);
  Limit& kept = side.limits[slot_of(fresh.second)];
  const bool tighter = fresh.offset < moved(side, kept, fresh.at - kept.at);
  if (kept.second != fresh.second || tighter) kept = fresh;
  if (fresh.at >= side.front.at && fresh.offset < highest(side, fresh.at)) side.front = fresh;
  return true;
}

void BoardClock::next_second(std::int64_t second) {
  narrow_drift(std::exchange(newest_second_, second));
  const double at = static_cast<double>(second) * 1e6;
  for (Side* const side : {&upper_, &lower_}) {
    side->front = {second, at, highest_of_all(*side, at)};
  }
}

// The offset stays between the limits, so the line through both limits bounds its slope.
void BoardClock::Slopes::narrow(const Limit& upper, const Limit& lower) {
  if (lower.at == upper.at) return;
  const double slope = (-lower.offset - upper.offset) / (lower.at - upper.at);
  if (lower.at > upper.at) {
    slowest = std::max(slowest, slope);
  } else {
    fastest = std::min(fastest, slope);
  }
}

void BoardClock::take_slopes(std::int64_t second) {
  const Limit& upper = upper_.limits[slot_of(second)];
  const Limit& lower = lower_.limits[slot_of(second)];
  for (std::int64_t before = second - seconds + 1; before <= second; ++before) {
    const std::size_t slot = slot_of(before);
    if (slopes_[slot].second != before) slopes_[slot] = {before};
    if (upper_.limits[slot].second == before && lower.second == second) {
      slopes_[slot].narrow(upper_.limits[slot], lower);
    }
    if (lower_.limits[slot].second == before && upper.second == second) {
      slopes_[slot].narrow(upper, lower_.limits[slot]);
    }
  }
}

// Takes the previous second again, because a late answer may have changed its limits.
void BoardClock::narrow_drift(std::int64_t second) {
  take_slopes(second - 1);
  take_slopes(second);
  slowest_ = -most_drift;
  fastest_ = most_drift;
  for (const Slopes& each : slopes_) {
    if (each.second == none || is_old(each.second)) continue;
    slowest_ = std::max(slowest_, each.slowest);
    fastest_ = std::min(fastest_, each.fastest);
  }
  if (slowest_ > fastest_) slowest_ = fastest_ = (slowest_ + fastest_) / 2;  // only by rounding
}

double BoardClock::moved(const Side& side, const Limit& limit, double later) const {
  const bool fastest = is_upper(side) == (later > 0);
  const double change = later * (fastest ? fastest_ : slowest_);
  return limit.offset + (is_upper(side) ? change : -change);
}

double BoardClock::highest(const Side& side, double at) const {
  const double later = at - side.front.at;
  return later < 0 ? highest_of_all(side, at) : moved(side, side.front, later);
}

double BoardClock::highest_of_all(const Side& side, double at) const {
  double offset = std::numeric_limits<double>::infinity();
  for (const Limit& each : side.limits) {
    if (each.second == none || is_old(each.second)) continue;
    offset = std::min(offset, moved(side, each, at - each.at));
  }
  return offset;
}

BoardClock::Instant BoardClock::at(std::uint32_t t_ms) const {
  const double board = since_first(t_ms);
  const double high = highest(upper_, board);
  const double low = -highest(lower_, board);
  const bool bounded = std::isfinite(high) && std::isfinite(low);
  const double offset = bounded ? (high + low) / 2 : std::isfinite(high) ? high : low;
  Instant instant;
  instant.at = first_ + Time{std::llround(board + offset)};
  if (bounded) instant.error = Time{std::llround(std::ceil((high - low) / 2)) + 1};
  return instant;
}

}  // namespace r4
