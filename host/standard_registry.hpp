// SPDX-License-Identifier: GPL-3.0-or-later
// The transports of the library: those of transports/ and `sim:`, the simulated board in this process.
#pragma once

#include "../transports/registry.hpp"

namespace r4 {

const Registry& standard_registry();

}  // namespace r4
