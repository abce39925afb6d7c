// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_clock.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace r4 {

namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();

}  // namespace

// Microseconds of the board's clock. An older T, too: datagrams overtake each other.
double BoardClock::since_first(std::uint32_t t_ms) const {
  const auto later = static_cast<std::int32_t>(t_ms - newest_t_ms_);
  return static_cast<double>(newest_board_ms_ + later) * 1000;
}

void BoardClock::limit(Limits& limits, std::uint32_t t_ms, Time host, Time margin) {
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
  if (place(limits, t_ms, host, margin)) return;
  // No clock that drifts by 100 ppm has shown all of that: one of the two has been set, or stood still
  // while the computer slept. What is new is true.
  restart();
  limit(limits, t_ms, host, margin);
}

// False: it contradicts what is known.
bool BoardClock::place(Limits& limits, std::uint32_t t_ms, Time host, Time margin) {
  Limit fresh;
  fresh.at = since_first(t_ms);
  fresh.second = static_cast<std::int64_t>(std::floor(fresh.at / 1e6));
  fresh.offset = static_cast<double>((host - first_ + margin).count()) - fresh.at;
  if (is_old(fresh.second)) return false;  // no datagram is under way for so long
  const bool is_upper = &limits == &upper_;
  if (is_upper ? fresh.offset < lowest(fresh.at) : fresh.offset > highest(fresh.at)) return false;
  if (fresh.second > newest_second_) next_second(fresh.second);
  Limit& kept = limits[slot_of(fresh.second)];
  const double later = fresh.at - kept.at;
  const double moved = kept.offset + later * (is_upper == (later > 0) ? fastest_ : slowest_);
  const bool tighter = is_upper ? fresh.offset < moved : fresh.offset > moved;
  if (kept.second != fresh.second || tighter) kept = fresh;
  if (is_upper && fresh.at >= high_.at && fresh.offset < highest(fresh.at)) {
    high_ = {fresh.at, fresh.offset};
  }
  if (!is_upper && fresh.at >= low_.at && fresh.offset > lowest(fresh.at)) {
    low_ = {fresh.at, fresh.offset};
  }
  return true;
}

// What has been learned in the last one tells more of the drift, and the oldest is forgotten.
void BoardClock::next_second(std::int64_t second) {
  narrow_drift(std::exchange(newest_second_, second));
  const double at = static_cast<double>(second) * 1e6;
  high_ = {at, highest_of_all(at)};
  low_ = {at, lowest_of_all(at)};
}

// A line through the gap between an upper and a lower limit cannot be steeper than from the one to the other.
void BoardClock::Slopes::narrow(const Limit& upper, const Limit& lower) {
  if (lower.at == upper.at) return;
  const double slope = (lower.offset - upper.offset) / (lower.at - upper.at);
  if (lower.at > upper.at) {
    slowest = std::max(slowest, slope);
  } else {
    fastest = std::min(fastest, slope);
  }
}

// The limits of that second beside those before it, and its own.
void BoardClock::take_slopes(std::int64_t second) {
  const Limit& upper = upper_[slot_of(second)];
  const Limit& lower = lower_[slot_of(second)];
  for (std::int64_t before = second - seconds + 1; before <= second; ++before) {
    const std::size_t slot = slot_of(before);
    if (slopes_[slot].second != before) slopes_[slot] = {before};
    if (upper_[slot].second == before && lower.second == second) {
      slopes_[slot].narrow(upper_[slot], lower);
    }
    if (lower_[slot].second == before && upper.second == second) {
      slopes_[slot].narrow(upper, lower_[slot]);
    }
  }
}

// That second is over. An answer from its end may still come.
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
  if (slowest_ > fastest_) slowest_ = fastest_ = (slowest_ + fastest_) / 2;  // of rounding
}

double BoardClock::highest(double at) const {
  return at < high_.at ? highest_of_all(at) : high_.offset + (at - high_.at) * fastest_;
}

double BoardClock::lowest(double at) const {
  return at < low_.at ? lowest_of_all(at) : low_.offset + (at - low_.at) * slowest_;
}

double BoardClock::highest_of_all(double at) const {
  double offset = infinite;
  for (const Limit& each : upper_) {
    if (each.second == none || is_old(each.second)) continue;
    const double later = at - each.at;
    offset = std::min(offset, each.offset + later * (later > 0 ? fastest_ : slowest_));
  }
  return offset;
}

double BoardClock::lowest_of_all(double at) const {
  double offset = -infinite;
  for (const Limit& each : lower_) {
    if (each.second == none || is_old(each.second)) continue;
    const double later = at - each.at;
    offset = std::max(offset, each.offset + later * (later > 0 ? slowest_ : fastest_));
  }
  return offset;
}

BoardClock::Instant BoardClock::at(std::uint32_t t_ms) const {
  const double board = since_first(t_ms);
  const double high = highest(board);
  const double low = lowest(board);
  const bool bounded = std::isfinite(high) && std::isfinite(low);
  const double offset = bounded ? (high + low) / 2 : std::isfinite(high) ? high : low;
  Instant instant;
  instant.at = first_ + Time{std::llround(board + offset)};
  if (bounded) instant.error = Time{std::llround(std::ceil((high - low) / 2)) + 1};
  return instant;
}

}  // namespace r4
