// SPDX-License-Identifier: GPL-3.0-or-later
#include "hal.hpp"

namespace r4 {
namespace firmware {

namespace {

template <class T, int N>
bool same(const T (&a)[N], const T (&b)[N]) {
  for (int i = 0; i < N; ++i) {
    if (a[i] != b[i]) return false;
  }
  return true;
}

}  // namespace

bool operator==(const Outputs& a, const Outputs& b) {
  return a.relays == b.relays && same(a.osmc, b.osmc) && same(a.dhb12, b.dhb12) &&
         same(a.servo_us, b.servo_us) && same(a.bldc, b.bldc) && same(a.stepper, b.stepper);
}

}  // namespace firmware
}  // namespace r4
