// SPDX-License-Identifier: GPL-3.0-or-later
#include "udp_url.hpp"

#include "r4link/error.hpp"

namespace r4 {

UdpUrl::UdpUrl(const Url& url, Role role)
    : text(url.text()),
      host(url.host()),
      port(url.port().value_or(board_port)),
      listen(static_cast<std::uint16_t>(url.get_number("listen", 0, 65535, host_port))) {
  if (host.empty() || !url.path().empty()) {
    throw Error(ErrorKind::usage, text, "it is not udp://HOST or udp://HOST:PORT",
                "write it as in udp://192.168.1.77:2018");
  }
  if (role == Role::host) {
    url.allow_only("listen");
    if (port == 0) {
      throw Error(ErrorKind::usage, text, "port 0 is no board's", "the board's is 2018");
    }
    return;
  }
  url.allow_only("peer");
  peer = url.get("peer").value_or("");
  if (!url.get("peer")) return;
  const Url parsed = Url::parse("udp://" + peer);
  peer_host = parsed.host();
  peer_port = parsed.port().value_or(host_port);
  if (peer_host.empty() || peer_port == 0 || !parsed.path().empty()) {
    throw Error(ErrorKind::usage, text, "'peer=" + peer + "' is not HOST or HOST:PORT",
                "write it as in peer=192.168.1.10:2390");
  }
}

}  // namespace r4
