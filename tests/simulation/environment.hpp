// SPDX-License-Identifier: GPL-3.0-or-later
// The number of simulations and the selected simulation, from environment variables.
#pragma once

#include <cstdint>
#include <cstdlib>

namespace r4::simulation {

inline std::uint64_t from_environment(const char* name, std::uint64_t otherwise) {
  const char* const value = std::getenv(name);
  return value == nullptr ? otherwise : std::strtoull(value, nullptr, 10);
}

}  // namespace r4::simulation
