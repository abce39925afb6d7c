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

// One spelling for an address. Host names other than localhost are not looked up.
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

std::unique_ptr<Carrier> make_udp_carrier(asio::io_context& io, const Url& url, Role role,
                                          Claim claim) {
  if (role == Role::board) return std::make_unique<UdpBoard>(io, url);
  return std::make_unique<UdpHost>(io, url, std::move(claim));
}

bool udp_has_own_port(const Url& text) { return UdpUrl(text, Role::host).listen == 0; }

ShareName udp_share_name(const Url& text) {
  const UdpUrl url(text, Role::host);
  const std::string from = url.local.is_unspecified() ? "" : "/" + url.local.to_string();
  return {fmt::format("udp/{}{}/{}/{}{}", url.search ? "?" : "",
                      url.search ? url.called : spelling_of(url.host), url.port, url.listen, from)};
}

}  // namespace r4
