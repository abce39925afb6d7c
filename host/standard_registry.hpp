// SPDX-License-Identifier: GPL-3.0-or-later
// The transports of the library: those of transports/, `sim:` (the simulated board in this
// process), and `replay:`.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "../transports/registry.hpp"
#include "r4link/options.hpp"

namespace r4 {

const Registry& standard_registry();

// The host's carrier for a URL, not yet opened. Throws Error{usage}. A watcher leaves the port of
// hosts (UDP 2390) to controlling hosts: it takes any free port, unless the URL names one.
std::unique_ptr<Carrier> make_host_carrier(asio::io_context& io, std::string_view url,
                                           BoardRole role);

// The carriers of all paths to one board. A text may join URLs (r4link/discovery/url_pattern.hpp). Throws
// Error{usage} for no URL, for more URLs than a session has paths, for a duplicate, and if one of
// several is a board of its own (sim:, replay:). Only the first udp: URL has the port of hosts,
// unless the URLs name ports.
std::vector<std::unique_ptr<Carrier>> make_host_carriers(asio::io_context& io,
                                                         const std::vector<std::string>& urls,
                                                         BoardRole role);

// Throws Error{usage} if a session cannot have that number of paths.
void require_paths(std::size_t count);

}  // namespace r4
