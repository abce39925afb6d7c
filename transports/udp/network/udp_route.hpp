// SPDX-License-Identifier: GPL-3.0-or-later
// The way to a board: does the system know one, and does the interface that it leads out by work? Nothing is sent to
// find out.
#pragma once

#include <asio/ip/address.hpp>
#include <asio/ip/udp.hpp>
#include <vector>

namespace r4 {

// An address of this computer, and whether its interface is up and has a carrier (a cable that is plugged in, a WiFi
// that is joined).
struct OwnAddress {
  asio::ip::address address;
  unsigned interface = 0;  // its index
  bool works = false;
};
// Empty where the system does not tell.
std::vector<OwnAddress> own_addresses();

// 0 if there is a way to that board, else errno. `from`: by the interface of that address; unspecified: by any.
int probe_route(const asio::ip::udp::endpoint& to, const asio::ip::address& from,
                const std::vector<OwnAddress>& own);

// Has the socket send to that board by the interface of that address, also where another leads there, too. What comes
// is taken from any. A board of this computer is reached anyway.
void send_by_interface_of(const asio::ip::address& from, int socket,
                          const asio::ip::udp::endpoint& to, const std::vector<OwnAddress>& own);

}  // namespace r4
