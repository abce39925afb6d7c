// SPDX-License-Identifier: GPL-3.0-or-later
// A quadrature encoder with an index or reference switch: four counts a cycle, frequency, and where
// the index was.
//
//     A  __/~~\__/~~\__      forward: A leads B, counts up
//     B  ___/~~\__/~~\_
//
// sample() takes the levels at every edge (interrupt) or at a rate well above the edges'. When both
// lines changed since the last sample an edge was missed: nothing is counted.
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
  // The level of the index line, whose rising edge says where the index is.
  void index(bool active);
  // Counts from here on. The index stays where it is: its count becomes one from here, too.
  void zero() { zero_at_ = travelled_.load(std::memory_order_relaxed); }

  // Counts since zero, forward positive; wraps at 32 bits.
  std::int32_t count() const { return from_zero(travelled_.load(std::memory_order_relaxed)); }
  // The count where the index line rose last; 0 before the first time.
  std::int32_t index_count() const {
    return index_seen_.load(std::memory_order_acquire)
               ? from_zero(index_at_.load(std::memory_order_relaxed))
               : 0;
  }

  // Call it now and then: takes the frequency whenever a window has passed.
  void measure(std::uint32_t now_us);
  // Counts a second over the last window; negative backwards.
  std::int32_t frequency_hz() const { return frequency_hz_; }

 private:
  std::int32_t from_zero(std::uint32_t at) const {
    return static_cast<std::int32_t>(at - zero_at_);
  }

  std::atomic<std::uint32_t> travelled_{0};  // counts since power-up
  std::atomic<std::uint32_t> index_at_{0};   // the same, where the index line rose last
  std::atomic<bool> index_seen_{false};
  std::uint32_t zero_at_ = 0;  // of the code that is interrupted alone
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
