// SPDX-License-Identifier: GPL-3.0-or-later
#include "hal.hpp"

#include "../protocol/datagram/same_elements.hpp"

namespace r4 {
namespace firmware {

bool operator==(const Outputs& a, const Outputs& b) {
#define R4_OUTPUT(kind, Value, member, ...) \
  if (!same_elements(a.member, b.member)) return false;
#include "r4link/tables/board.def"
  return a.relays == b.relays && same_elements(a.stepper, b.stepper);
}

}  // namespace firmware
}  // namespace r4
