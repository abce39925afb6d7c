// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace r4::tool::ros2 {

// As rcl_interfaces/Log has them.
enum class LogLevel : std::uint8_t { info = 20, warning = 30, error = 40 };

}  // namespace r4::tool::ros2
