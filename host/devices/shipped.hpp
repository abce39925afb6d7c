// SPDX-License-Identifier: GPL-3.0-or-later
// The descriptions that are shipped: host/devices/*.device, which CMake puts into the library.
#pragma once

#include <span>
#include <string_view>

namespace r4 {

struct ShippedDescription {
  std::string_view name;
  std::string_view text;
};

// In the order of their names.
extern const std::span<const ShippedDescription> shipped_descriptions;

}  // namespace r4
