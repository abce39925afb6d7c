// SPDX-License-Identifier: GPL-3.0-or-later
#include "guard.hpp"

#include "../protocol/datagram/wrapping.hpp"

namespace r4 {
namespace firmware {

Guard::Duty Guard::add_duty(std::uint32_t limit_ms) {
  if (duty_count_ == max_duties) {
    unwatched_ = true;
    return no_duty;
  }
  duties_[duty_count_].limit_ms = limit_ms;
  return duty_count_++;
}

void Guard::arm(std::uint32_t deadline_ms) {
  deadline_ms_.store(deadline_ms, std::memory_order_relaxed);
  armed_.store(true, std::memory_order_release);
}

bool Guard::tick(std::uint32_t now_ms) {
  if (!started_) {
    started_ = true;
    for (Watched& duty : duties_) duty.seen_ms = now_ms;
  }
  if (debt_ != 0) --debt_;
  if (unwatched_) trip(SafeReason::watchdog);
  bool all_seen = !unwatched_;
  for (int i = 0; i < duty_count_; ++i) {
    Watched& duty = duties_[i];
    if (duty.seen.exchange(false, std::memory_order_relaxed)) {
      duty.seen_ms = now_ms;
      duty.due = false;
    } else if (now_ms - duty.seen_ms >= duty.limit_ms) {
      duty.seen_ms = now_ms;
      missed_.fetch_add(1, std::memory_order_relaxed);
      debt_ += miss_cost;
    }
    if (duty.due) all_seen = false;
  }
  if (debt_ > credit) {
    debt_ = 0;
    trip(SafeReason::watchdog);
  }
  const std::uint32_t stops = stops_heard();
  if (stops != stops_obeyed_) {
    stops_obeyed_ = stops;
    trip(SafeReason::stop);
  }
  if (armed_.load(std::memory_order_acquire) &&
      reached(now_ms, deadline_ms_.load(std::memory_order_relaxed))) {
    disarm();
    trip(SafeReason::link);
  }
  if (all_seen) {
    for (Watched& duty : duties_) duty.due = true;
  }
  return all_seen;
}

// Makes the outputs safe once for each cause, and remembers the graver cause.
void Guard::trip(SafeReason cause) {
  const SafeReason before = tripped_.load(std::memory_order_relaxed);
  if (before == SafeReason::stop || before == cause) return;
  if (before == SafeReason::watchdog && cause == SafeReason::link) return;
  tripped_.store(cause, std::memory_order_relaxed);
  hal_.make_safe();
}

}  // namespace firmware
}  // namespace r4
