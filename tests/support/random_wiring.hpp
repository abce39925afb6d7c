// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "r4link/wiring/wiring.hpp"

namespace r4::test {

// A wiring without a fault: each signal at any place that it can have, with any option. Sometimes a
// chip is not fitted or a signal is not connected. The same seed gives the same wiring.
Wiring random_wiring(std::uint64_t seed);

}  // namespace r4::test
