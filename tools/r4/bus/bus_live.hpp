// SPDX-License-Identifier: GPL-3.0-or-later
// `r4 bus can://can0`: how full a real CAN bus is, per id, by listening only.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "../shell/options.hpp"

namespace r4::tool {

constexpr std::uint32_t usual_bit_rate = 1000000;  // bit/s

struct LiveBusOptions {
  std::string url;  // can://INTERFACE
  bool json = false;
  // On a terminal without: the last second again and again, until Ctrl-C. Else 5 s.
  std::optional<Milliseconds> duration;
  // Where the interface does not tell: of a virtual bus, as if it had that.
  std::optional<std::uint32_t> bit_rate;       // 1 Mbit/s
  std::optional<std::uint32_t> data_bit_rate;  // of CAN FD; none: frames do not switch
};

// `nearly_full`: the load, 0–1, above which a warning is given. Throws Error.
void show_live_bus(const LiveBusOptions& options, double nearly_full);

}  // namespace r4::tool
