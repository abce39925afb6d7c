// SPDX-License-Identifier: GPL-3.0-or-later
// The descriptions that are shipped: host/devices/*.device, as CMake has put them into the library.
#pragma once

#include <cstddef>
#include <string_view>

namespace r4 {

struct ShippedDescription {
  std::string_view name;
  std::string_view text;
};

// By their names, in order.
extern const ShippedDescription shipped_descriptions[];
extern const std::size_t shipped_description_count;

}  // namespace r4
