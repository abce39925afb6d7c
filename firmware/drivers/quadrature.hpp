// SPDX-License-Identifier: GPL-3.0-or-later
// A quadrature encoder with an index or reference switch: four counts per cycle.
//     A  __/~~\__/~~\__      forward: A leads B, counts up
//     B  ___/~~\__/~~\_
//
// sample() takes the levels at every edge (interrupt), or faster than the edges. If both lines
// changed, an edge was missed and the count does not change. sample() and index() may run in an
// interrupt, the other functions in the code that it interrupts, on one core.
#pragma once

#include <atomic>
#include <cstdint>

namespace r4 {
namespace firmware {

class QuadratureEncoder {
 public:
  static constexpr std::uint32_t frequency_window_us = 100000;

  void sample(bool a, bool b);
  void index(bool active);
  // Makes this position 0, also for the index's count.
  void zero() { zero_at_ = travelled_.load(std::memory_order_relaxed); }

  // Counts since zero, forward positive; wraps at 32 bits.
  std::int32_t count() const { return from_zero(travelled_.load(std::memory_order_relaxed)); }
  // The count at the last rising edge of the index line; 0 before the first.
  std::int32_t index_count() const {
    return index_seen_.load(std::memory_order_acquire)
               ? from_zero(index_at_.load(std::memory_order_relaxed))
               : 0;
  }

  // Call regularly: measures the frequency whenever a window has passed.
  void measure(std::uint32_t now_us);
  // Counts per second over the last window; negative backwards.
  std::int32_t frequency_hz() const { return frequency_hz_; }

 private:
  std::int32_t from_zero(std::uint32_t at) const {
    return static_cast<std::int32_t>(at - zero_at_);
  }

  std::atomic<std::uint32_t> travelled_{0};  // counts since power-up
  std::atomic<std::uint32_t> index_at_{0};   // travelled_ at the last rising edge of the index line
  std::atomic<bool> index_seen_{false};
  std::uint32_t zero_at_ = 0;
  // Used by sample() and index() only.
  std::uint8_t levels_ = unknown;
  bool index_active_ = false;
  // Used by measure() only.
  bool measuring_ = false;
  std::uint32_t window_began_us_ = 0;
  std::uint32_t window_began_at_ = 0;
  std::int32_t frequency_hz_ = 0;

  static constexpr std::uint8_t unknown = 0xFF;
};

}  // namespace firmware
}  // namespace r4
