// SPDX-License-Identifier: GPL-3.0-or-later
#include "udp_carrier.hpp"

#include <fmt/format.h>

#include <asio/ip/address.hpp>
#include <utility>

#include "udp_board.hpp"
#include "udp_host.hpp"
#include "udp_url.hpp"

namespace r4 {
namespace {

// However it is written. What another name means is known too late for this.
std::string spelling_of(const std::string& host) {
  std::string name = host;
  for (char& c : name) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  if (name == "localhost") return "127.0.0.1";
  asio::error_code error;
  const asio::ip::address address = asio::ip::make_address(name, error);
  return error ? name : address.to_string();
}

}  // namespace

std::unique_ptr<Carrier> make_udp_carrier(asio::io_context& io, const Url& url, Role role) {
  return make_udp_carrier_with(io, url, role, HostLookup());
}

std::unique_ptr<Carrier> make_udp_carrier_with(asio::io_context& io, const Url& url, Role role,
                                               HostLookup lookup, BoardSearch search) {
  if (role == Role::board) return std::make_unique<UdpBoard>(io, url, std::move(lookup));
  return std::make_unique<UdpHost>(io, url, std::move(lookup), std::move(search),
                                   std::make_shared<DeviceClaim>());
}

std::unique_ptr<Carrier> make_claimed_udp_carrier(asio::io_context& io, const Url& url,
                                                  std::shared_ptr<DeviceClaim> claim) {
  return std::make_unique<UdpHost>(io, url, HostLookup(), BoardSearch(), std::move(claim));
}

bool udp_has_own_port(const Url& text) { return UdpUrl(text, Role::host).listen == 0; }

ShareName udp_share_name(const Url& text) {
  const UdpUrl url(text, Role::host);
  if (url.listen == 0) return {};
  // Who watches has that port, too, if the URL names it, else one of its own.
  const std::string from = url.local.is_unspecified() ? "" : "/" + url.local.to_string();
  return {fmt::format("udp/{}{}/{}/{}{}", url.search ? "?" : "",
                      url.search ? url.called : spelling_of(url.host), url.port, url.listen, from)};
}

}  // namespace r4
