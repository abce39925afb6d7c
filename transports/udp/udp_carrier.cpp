// SPDX-License-Identifier: GPL-3.0-or-later
#include "udp_carrier.hpp"

#include <fmt/core.h>

#include <utility>

#include "udp_board.hpp"
#include "udp_host.hpp"
#include "udp_url.hpp"

namespace r4 {

std::unique_ptr<Carrier> make_udp_carrier(asio::io_context& io, const Url& url, Role role) {
  return make_udp_carrier_with(io, url, role, HostLookup());
}

std::unique_ptr<Carrier> make_udp_carrier_with(asio::io_context& io, const Url& url, Role role,
                                               HostLookup lookup, BoardSearch search) {
  if (role == Role::board) return std::make_unique<UdpBoard>(io, url, std::move(lookup));
  return std::make_unique<UdpHost>(io, url, std::move(lookup), std::move(search));
}

bool udp_has_own_port(const Url& text) { return UdpUrl(text, Role::host).listen == 0; }

SharedWire udp_wire(const Url& text) {
  const UdpUrl url(text, Role::host);
  if (url.listen == 0) return {};
  // Who watches has that port, too, if the URL names it, else one of its own.
  return {fmt::format("udp/{}{}/{}/{}", url.search ? "?" : "", url.search ? url.called : url.host,
                      url.port, url.listen),
          text.get("listen").has_value()};
}

}  // namespace r4
