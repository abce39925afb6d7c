// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/wiring/wiring.hpp"

namespace r4 {

Wiring plan_wiring() {
  constexpr std::uint8_t plan[] = {
#define R4_SIGNAL(kind, terminal, channels, partner, name, part, option, ...) __VA_ARGS__,
#include "r4link/tables/board.def"
  };
  static_assert(sizeof plan == signal_count, "each signal of tables/board.def has a place");
  Wiring wiring;
  for (int i = 0; i < signal_count; ++i) wiring.places[i].byte = plan[i];
  return wiring;
}

const char* to_text(WiringSource source) {
  switch (source) {
    case WiringSource::plan:
      return "plan";
    case WiringSource::given:
      return "given";
    case WiringSource::damaged:
      break;
  }
  return "damaged";
}

}  // namespace r4
