// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_clock.hpp"

#include "chip.hpp"

namespace r4 {
namespace giga {

namespace {

std::atomic<std::uint32_t> shown_ms{0};  // NOLINT(cppcoreguidelines-avoid-non-const-*)
// Not atomic, because after start() only advance() uses it.
std::uint32_t counted_us = 0;  // shown_ms counts up to this time  NOLINT

}  // namespace

void BoardClock::start(std::uint32_t first_ms) {
  counted_us = now_us();
  shown_ms.store(first_ms);
}

void BoardClock::advance() {
  const std::uint32_t passed_ms = (now_us() - counted_us) / 1000;
  counted_us += passed_ms * 1000;
  shown_ms.store(shown_ms.load(std::memory_order_relaxed) + passed_ms, std::memory_order_release);
}

std::uint32_t BoardClock::now_us() { return us_ticker_read(); }

std::uint32_t BoardClock::now_ms() { return shown_ms.load(std::memory_order_acquire); }

}  // namespace giga
}  // namespace r4
