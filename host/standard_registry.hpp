// SPDX-License-Identifier: GPL-3.0-or-later
// The transports of the library: those of transports/ and `sim:`, the simulated board in this process.
#pragma once

#include <memory>
#include <string_view>

#include "../transports/registry.hpp"
#include "r4link/options.hpp"

namespace r4 {

const Registry& standard_registry();

// The host's carrier for a URL, not yet opened. Throws Error{usage}. A program that only watches leaves the port
// of hosts (UDP 2390) to those that control: it takes any free one, unless the URL names one.
std::unique_ptr<Carrier> make_host_carrier(asio::io_context& io, std::string_view url,
                                           BoardRole role);

}  // namespace r4
