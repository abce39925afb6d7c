// SPDX-License-Identifier: GPL-3.0-or-later
// `r4 bus can://can0`: measures the load of a real CAN bus, per id, by listening only.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "../shell/options.hpp"

namespace r4::tool {

constexpr std::uint32_t usual_bit_rate = 1000000;  // bit/s

struct LiveBusOptions {
  std::string url;
  bool json = false;
  // If not set: on a terminal, show the load of the last second until Ctrl-C; else measure 5 s.
  std::optional<Milliseconds> duration;
  // If the interface (such as a virtual bus) reports no bit rate, this rate is used.
  std::optional<std::uint32_t> bit_rate;       // default 1 Mbit/s
  std::optional<std::uint32_t> data_bit_rate;  // CAN FD only; none: frames do not switch the rate
};

// `nearly_full`: load, 0 to 1, above which a warning is printed. Throws Error.
void show_live_bus(const LiveBusOptions& options, double nearly_full);

}  // namespace r4::tool
