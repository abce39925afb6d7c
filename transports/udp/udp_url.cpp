// SPDX-License-Identifier: GPL-3.0-or-later
#include "udp_url.hpp"

#include "../../protocol/messages/site_settings.hpp"
#include "r4link/error.hpp"

namespace r4 {
namespace {

bool is_search(const Url& url, Role role) {
  return role == Role::host && url.host().empty() && (url.path() == "auto" || url.get("id"));
}

// A board whose URL names no address listens to programs of this computer only.
std::string host_of(const Url& url, Role role) {
  const bool listens = role == Role::board && url.path().empty() && url.text().find("//") == 4;
  return url.host().empty() && listens ? "127.0.0.1" : url.host();
}

asio::ip::address local_address(const std::string& text, const std::string& url) {
  asio::error_code error;
  asio::ip::address address = asio::ip::make_address(text, error);
  if (!error && !address.is_unspecified() && !address.is_multicast()) return address;
  throw Error(ErrorKind::usage, url, "'local=" + text + "' is not an address of this computer",
              "write one that `ip -brief address` shows, as in local=192.168.0.7");
}

std::uint16_t port_of(const Url& url, Role role) {
  if (!is_search(url, role)) return url.port().value_or(UdpUrl::board_port);
  return static_cast<std::uint16_t>(url.get_number("port", 1, 65535, UdpUrl::board_port));
}

}  // namespace

UdpUrl::UdpUrl(const Url& url, Role role)
    : text(url.text()),
      search(is_search(url, role)),
      called(url.get("id").value_or("")),
      host(host_of(url, role)),
      port(port_of(url, role)),
      listen(static_cast<std::uint16_t>(url.get_number("listen", 0, 65535, host_port))),
      names_listen(url.get("listen").has_value()) {
  if (search) {
    const bool by_id = url.get("id").has_value();
    url.allow_only(by_id ? "id port listen" : "port listen");
    if (by_id && (!url.path().empty() || !is_board_id(Text(called)))) {
      throw Error(ErrorKind::usage, text, "it does not name one board",
                  "write udp:auto, or udp:?id=NAME with a name or id that r4 list shows");
    }
    return;
  }
  if (host.empty() || !url.path().empty()) {
    throw Error(ErrorKind::usage, text, "it is not udp://HOST or udp://HOST:PORT",
                role == Role::host
                    ? "write it as in udp://192.168.1.77:2018, or udp:auto, or udp:?id=NAME"
                    : "write it as in udp://192.168.1.77:2018");
  }
  if (role == Role::host) {
    url.allow_only("listen local");
    if (const auto text_of_it = url.get("local")) local = local_address(*text_of_it, text);
    if (port == 0) {
      throw Error(ErrorKind::usage, text, "no board has port 0", "the board's is 2018");
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

std::string with_own_port(std::string url) {
  const Url parsed = Url::parse(url);
  if (parsed.scheme() != "udp" || parsed.get("listen")) return url;
  return url + (url.find('?') == std::string::npos ? "?listen=0" : "&listen=0");
}

std::string with_any_port(std::string url) {
  url = with_own_port(std::move(url));
  if (Url::parse(url).scheme() != "udp") return url;
  constexpr std::string_view key = "listen=";
  std::size_t at = url.find('?');
  while (url.compare(at + 1, key.size(), key) != 0) at = url.find('&', at + 1);
  at += 1 + key.size();
  return url.replace(at, std::min(url.find('&', at), url.size()) - at, "0");
}

}  // namespace r4
