// SPDX-License-Identifier: GPL-3.0-or-later
// The shipped descriptions: CMake puts host/devices/*.device into the library.
#pragma once

#include <span>
#include <string_view>

namespace r4 {

struct ShippedDescription {
  std::string_view name;
  std::string_view text;
};

extern const std::span<const ShippedDescription> shipped_descriptions;  // sorted by name

}  // namespace r4
