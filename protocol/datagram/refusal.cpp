// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/vocabulary.hpp"

namespace r4 {
namespace {

constexpr Text names[] = {"NONE",      "UNKNOWN", "FORMAT", "RANGE", "CHANNEL", "STALE",
                          "DUPLICATE", "SAFE",    "BUSY",   "AUTH",  "FULL"};
constexpr std::size_t name_count = sizeof names / sizeof names[0];
static_assert(name_count == static_cast<std::size_t>(Refusal::full) + 1, "a name for every code");

}  // namespace

Text name_of(Refusal refusal) {
  const std::size_t index = static_cast<std::size_t>(refusal);
  return index < name_count ? names[index] : names[0];
}

Refusal refusal_from(Text name) {
  for (std::size_t i = 1; i < name_count; ++i) {
    if (names[i] == name) return static_cast<Refusal>(i);
  }
  return Refusal::none;
}

}  // namespace r4
