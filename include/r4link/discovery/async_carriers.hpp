// SPDX-License-Identifier: GPL-3.0-or-later
// Carriers for programs that open each path themselves. With r4link::asio only.
#pragma once

#include <asio/io_context.hpp>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "../carrier.hpp"
#include "../options.hpp"

namespace r4 {

// The host's carrier for a URL, not yet opened. Throws Error{usage}. Unless the URL names a port, a
// watcher uses any free UDP port, because port 2390 is for controlling hosts.
std::unique_ptr<Carrier> make_host_carrier(asio::io_context& io, std::string_view url,
                                           BoardRole role);

// The carriers of all paths to one board. A text may join URLs (url_pattern.hpp). Throws
// Error{usage} for no URL, too many URLs, a duplicate, and a sim: or replay: among several URLs.
// Unless the URLs name ports, only the first udp: URL uses port 2390.
std::vector<std::unique_ptr<Carrier>> make_host_carriers(asio::io_context& io,
                                                         const std::vector<std::string>& urls,
                                                         BoardRole role);

// A host's carrier that is not shared with other programs of this computer, not yet opened. The
// carrier works while another program holds the transport and hangs: on any free UDP port, or on a
// bus beside that program. Only one program can use a serial port. Throws Error{usage}.
std::unique_ptr<Carrier> make_own_carrier(asio::io_context& io, std::string_view url);

}  // namespace r4
