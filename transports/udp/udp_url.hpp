// SPDX-License-Identifier: GPL-3.0-or-later
// The URL of a UDP carrier, taken apart (udp_carrier.hpp).
#pragma once

#include <asio/ip/address.hpp>
#include <cstdint>
#include <string>

#include "../url.hpp"
#include "r4link/carrier.hpp"

namespace r4 {

struct UdpUrl {
  static constexpr std::uint16_t board_port = 2018;
  static constexpr std::uint16_t host_port = 2390;

  // Throws Error{usage} for one that UDP does not take.
  UdpUrl(const Url& url, Role role);

  std::string text;
  bool search = false;   // udp:auto, udp:?id=NAME: the board is to be found
  std::string called;    // its name or board id; empty: the only one
  std::string host;      // the board's; at a board: where it listens
  std::uint16_t port;    // of the board
  std::uint16_t listen;  // of the host
  bool names_listen;     // the URL says so
  asio::ip::address
      local;         // of this computer, by whose interface the host sends; unspecified: by any
  std::string peer;  // HOST or HOST:PORT; empty: none
  std::string peer_host;
  std::uint16_t peer_port = host_port;
};

// The URL by which a host opens a board. If it is one of UDP and names no port to listen at, any
// free one is added; others come back as they are.
std::string with_own_port(std::string url);
// The same, and a port that it names is replaced, too.
std::string with_any_port(std::string url);

}  // namespace r4
