// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "../shell/options.hpp"

namespace r4::tool {

struct BusMonitorOptions {
  std::string interface;
  bool json = false;
  std::uint64_t count = 0;  // states of all boards together; 0: unlimited
  std::optional<Milliseconds> duration;
};

// Ends by `count`, `duration` or a signal. Throws Error{refused} if no board was heard.
void monitor_bus(const BusMonitorOptions& options);

}  // namespace r4::tool
