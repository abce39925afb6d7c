// SPDX-License-Identifier: GPL-3.0-or-later
// A quadrature encoder with an index or reference switch: four counts a cycle, frequency, and the
// transitions that cannot be.
//
//     A  __/~~\__/~~\__      forward: A leads B, counts up
//     B  ___/~~\__/~~\_
//
// sample() takes the levels at every edge (interrupt) or at a rate well above the edges'. When both
// lines changed since the last sample an edge was missed: nothing is counted, the transition is.
// sample() and index() may run in an interrupt, the rest in the code it interrupts, on one core.
#pragma once

#include <atomic>
#include <cstdint>

namespace r4 {
namespace firmware {

class QuadratureEncoder {
 public:
  static constexpr std::uint32_t frequency_window_us = 100000;

  void sample(bool a, bool b);
  // The level of the index line; at its rising edge the count is latched, and set to zero if so
  // wanted.
  void index(bool active);
  void zero_on_index(bool wanted) { zero_on_index_ = wanted; }
  void zero() { count_.store(0, std::memory_order_relaxed); }

  // Counts since zero, forward positive; wraps at 32 bits.
  std::int32_t count() const { return count_.load(std::memory_order_relaxed); }
  std::uint32_t illegal() const { return illegal_.load(std::memory_order_relaxed); }
  // How often the index line rose, and the count at the last time.
  std::uint32_t index_pulses() const { return index_pulses_.load(std::memory_order_relaxed); }
  std::int32_t index_count() const { return index_count_.load(std::memory_order_relaxed); }

  // Call it now and then: takes the frequency whenever a window has passed.
  void measure(std::uint32_t now_us);
  // Counts a second over the last window; negative backwards.
  std::int32_t frequency_hz() const { return frequency_hz_; }

 private:
  std::atomic<std::int32_t> count_{0};
  std::atomic<std::uint32_t> travelled_{0};  // as count_, but never set to zero
  std::atomic<std::uint32_t> illegal_{0};
  std::atomic<std::uint32_t> index_pulses_{0};
  std::atomic<std::int32_t> index_count_{0};
  std::atomic<bool> zero_on_index_{false};
  // Of sample() and index() alone.
  std::uint8_t levels_ = unknown;
  bool index_active_ = false;
  // Of measure() alone.
  bool measuring_ = false;
  std::uint32_t window_began_us_ = 0;
  std::uint32_t window_began_at_ = 0;
  std::int32_t frequency_hz_ = 0;

  static constexpr std::uint8_t unknown = 0xFF;
};

}  // namespace firmware
}  // namespace r4
