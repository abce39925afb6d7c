// SPDX-License-Identifier: GPL-3.0-or-later
#include "quadrature.hpp"

namespace r4 {
namespace firmware {

namespace {

// Counts from levels AB (row) to AB (column). If both change, the direction is unknown: 0.
constexpr std::int8_t steps[4][4] = {
    // 00 01 10 11
    {0, -1, 1, 0},
    {1, 0, 0, -1},
    {-1, 0, 0, 1},
    {0, 1, -1, 0},
};

}  // namespace

void QuadratureEncoder::sample(bool a, bool b) {
  const auto levels = static_cast<std::uint8_t>((a ? 2 : 0) | (b ? 1 : 0));
  if (levels_ == unknown) levels_ = levels;
  const std::int8_t step = steps[levels_][levels];
  levels_ = levels;
  const auto change = static_cast<std::uint32_t>(static_cast<std::int32_t>(step));
  travelled_.store(travelled_.load(std::memory_order_relaxed) + change, std::memory_order_relaxed);
}

void QuadratureEncoder::index(bool active) {
  if (active && !index_active_) {
    index_at_.store(travelled_.load(std::memory_order_relaxed), std::memory_order_relaxed);
    index_seen_.store(true, std::memory_order_release);
  }
  index_active_ = active;
}

void QuadratureEncoder::measure(std::uint32_t now_us) {
  const std::uint32_t travelled = travelled_.load(std::memory_order_relaxed);
  const std::uint32_t passed_us = now_us - window_began_us_;
  if (measuring_ && passed_us < frequency_window_us) return;
  if (measuring_) {
    const std::int64_t counts = static_cast<std::int32_t>(travelled - window_began_at_);
    frequency_hz_ = static_cast<std::int32_t>(counts * 1000000 / std::int64_t{passed_us});
  }
  measuring_ = true;
  window_began_us_ = now_us;
  window_began_at_ = travelled;
}

}  // namespace firmware
}  // namespace r4
