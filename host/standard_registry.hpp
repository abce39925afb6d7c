// SPDX-License-Identifier: GPL-3.0-or-later
// The library's transports: transports/, `sim:` (a simulated board in this process), and `replay:`.
#pragma once

#include <cstddef>

#include "../transports/registry.hpp"
#include "r4link/discovery/async_carriers.hpp"

namespace r4 {

const Registry& standard_registry();

// Throws Error{usage} if a session cannot have `count` paths.
void require_paths(std::size_t count);

}  // namespace r4
