// SPDX-License-Identifier: GPL-3.0-or-later
#include "udp_url.hpp"

#include <optional>
#include <regex>

#include "../../protocol/messages/site_settings.hpp"
#include "r4link/error.hpp"

namespace r4 {

UdpUrl::UdpUrl(const Url& url, Role role)
    : text(url.text()),
      called(url.get("id").value_or("")),
      host(url.host()),
      port(url.port().value_or(board_port)),
      listen(static_cast<std::uint16_t>(url.get_number("listen", 0, 65535, host_port))),
      names_listen(url.get("listen").has_value()) {
  const bool by_id = url.get("id").has_value();
  search = role == Role::host && host.empty() && (url.path() == "auto" || by_id);
  if (search) {
    port = static_cast<std::uint16_t>(url.get_number("port", 1, 65535, board_port));
    url.allow_only(by_id ? "id port listen" : "port listen");
    if (by_id && (!url.path().empty() || !is_board_id(Text(called)))) {
      throw Error(ErrorKind::usage, text, "the URL does not name one board",
                  "write udp:auto, or udp:?id=NAME with a name or id that r4 list shows");
    }
    return;
  }
  // A board whose URL names no address listens to programs of this computer only.
  if (role == Role::board && host.empty() && text.find("//") == 4) host = "127.0.0.1";
  if (host.empty() || !url.path().empty()) {
    throw Error(ErrorKind::usage, text, "the URL is not udp://HOST or udp://HOST:PORT",
                role == Role::host
                    ? "write a URL such as udp://192.168.1.77:2018, or udp:auto, or udp:?id=NAME"
                    : "write a URL such as udp://192.168.1.77:2018");
  }
  if (role == Role::host) {
    url.allow_only("listen local");
    const std::optional<std::string> from = url.get("local");
    asio::error_code error;
    if (from) local = asio::ip::make_address(*from, error);
    if (from && (error || local.is_unspecified() || local.is_multicast())) {
      throw Error(ErrorKind::usage, text,
                  "'local=" + *from + "' is not an address of this computer",
                  "write an address that `ip -brief address` shows, such as local=192.168.0.7");
    }
    if (port == 0) {
      throw Error(ErrorKind::usage, text, "0 is not a valid port of a board",
                  "use the board's port, which is 2018");
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
                "write a peer such as peer=192.168.1.10:2390");
  }
}

std::string with_own_port(std::string url) {
  const Url parsed = Url::parse(url);
  if (parsed.scheme() != "udp" || parsed.get("listen")) return url;
  return url + (url.find('?') == std::string::npos ? "?listen=0" : "&listen=0");
}

std::string with_any_port(std::string url) {
  if (Url::parse(url).scheme() != "udp") return url;
  return std::regex_replace(with_own_port(std::move(url)), std::regex("([?&]listen=)[^&]*"),
                            "$010");
}

}  // namespace r4
