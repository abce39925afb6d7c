// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <asio/ip/address.hpp>
#include <cstdint>
#include <string>

#include "r4link/carrier.hpp"
#include "r4link/discovery/url.hpp"

namespace r4 {

struct UdpUrl {
  static constexpr std::uint16_t board_port = 2018;
  static constexpr std::uint16_t host_port = 2390;

  // Throws Error{usage} if `url` is not a valid UDP URL for `role`.
  UdpUrl(const Url& url, Role role);

  std::string text;
  bool search = false;  // udp:auto, udp:?id=NAME: a search finds the board
  std::string called;   // the board's name or id; empty: the only board
  std::string host;     // the board's host; at a board: the own address
  std::uint16_t port;
  std::uint16_t listen;
  bool names_listen;
  // The host sends by the interface with that address; unspecified: by any interface.
  asio::ip::address local;
  std::string peer;  // HOST or HOST:PORT; empty: none
  std::string peer_host;
  std::uint16_t peer_port = host_port;
};

// The URL of a host. A UDP URL without `listen` gets `listen=0` (any free port).
std::string with_own_port(std::string url);
// As with_own_port(), but also replaces the port of `listen`.
std::string with_any_port(std::string url);

}  // namespace r4
