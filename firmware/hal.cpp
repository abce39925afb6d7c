// SPDX-License-Identifier: GPL-3.0-or-later
#include "hal.hpp"

#include "../protocol/datagram/same_elements.hpp"

namespace r4 {
namespace firmware {

bool operator==(const Outputs& a, const Outputs& b) {
  return a.relays == b.relays && same_elements(a.osmc, b.osmc) && same_elements(a.dhb12, b.dhb12) &&
         same_elements(a.servo_us, b.servo_us) && same_elements(a.bldc, b.bldc) &&
         same_elements(a.stepper, b.stepper) && same_elements(a.dac_mv, b.dac_mv);
}

}  // namespace firmware
}  // namespace r4
