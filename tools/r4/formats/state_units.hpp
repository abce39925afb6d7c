// SPDX-License-Identifier: GPL-3.0-or-later
// What the values of state fields are counted in, for people.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "r4link/state.hpp"

namespace r4::tool {

// A field's values: "pwm [0-4095]", "direction [0/1]"; of a field that has one only, "[V]".
struct StateUnits {
  std::array<std::string_view, 3> values;
  std::size_t count;
};

// Of a value that is no number: "x3b00".
constexpr std::string_view bytes_unit = "bytes [hex]";

StateUnits units_of(StateField field);

}  // namespace r4::tool
