// SPDX-License-Identifier: GPL-3.0-or-later
// The own addresses, and the route to a board: whether it exists, and whether its interface works.
// Sends nothing.
#pragma once

#include <asio/ip/address.hpp>
#include <asio/ip/udp.hpp>
#include <string>
#include <vector>

namespace r4 {

struct OwnAddress {
  asio::ip::address address;
  unsigned interface = 0;
  bool works = false;     // the interface is up and has a carrier (a plugged cable, a joined WiFi)
  std::string name = {};  // of the interface
  // Reaches the computers of its network; of the loopback: itself. Unspecified: none.
  asio::ip::address_v4 broadcast = {};
};
// Empty if the system does not report its addresses.
std::vector<OwnAddress> own_addresses();

// 0 if there is a route to `to`, else errno. If `from` is specified: only by its interface.
int probe_route(const asio::ip::udp::endpoint& to, const asio::ip::address& from,
                const std::vector<OwnAddress>& own);

// Makes the socket send to that board by the interface of `from`, even if another interface has a
// route to the board. The socket receives by any interface. No effect for a board on this computer.
void send_by_interface_of(const asio::ip::address& from, int socket,
                          const asio::ip::udp::endpoint& to, const std::vector<OwnAddress>& own);

}  // namespace r4
