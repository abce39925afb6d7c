// SPDX-License-Identifier: GPL-3.0-or-later
// Repeatable random numbers: SplitMix64 (Steele, Lea, Flood 2014).
#pragma once

#include <cstdint>

namespace r4 {
namespace sim {

constexpr std::uint64_t scramble(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15U;
  x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9U;
  x = (x ^ x >> 27) * 0x94d049bb133111ebU;
  return x ^ x >> 31;
}

}  // namespace sim
}  // namespace r4
