// SPDX-License-Identifier: GPL-3.0-or-later
// Datagrams over UDP, one a packet, on the ports of the paper.
//
//     host    udp://HOST[:2018][?listen=2390]        sends to HOST:2018 from port 2390 and hears
//                                                    HOST there, from any of its ports; listen=0
//                                                    takes any free port. Boards of one program
//                                                    share the port (udp_host_socket.hpp).
//                                                    local=ADDRESS sends from that address of this
//                                                    computer, by its interface
//             udp:auto[?port=2018&listen=…]      the only board on the networks of this computer
//                                                (board_search.hpp)
//             udp:?id=NAME[&port=…&listen=…]     the board of that name, or of that board id
//     board   udp://BIND[:2018][?peer=HOST[:2390]]   port 0 takes any free port, which name() shows
//
// A board knows the last 16 hosts that sent a valid datagram, and always the host in control. A
// board with a peer sends datagrams for everyone to that peer. A board without a peer sends them to
// the host in control, else to the host heard last. An answer goes to the sender of the question.
// The paper's Python client asks from a port at which it does not listen, so an answer to another
// port of the peer's address also goes to the peer.
//
// A name is looked up in open(), IPv4 first. Within a handler of the loop a host's open() does not
// wait for that: the host is `down` until the name is known, and asks each second. A host that has
// heard nothing valid for 3 to 6 s looks the name up again, or searches again, and follows the
// board to its new address. The board that a search has found stays the wanted board until close().
// A board that is off (port unreachable) is a quiet board. An unreachable network is a failure:
// `down`, tried again five times a second.
#pragma once

#include <asio/io_context.hpp>
#include <memory>

#include "../share_name.hpp"
#include "r4link/carrier.hpp"
#include "r4link/discovery/url.hpp"
#include "search/board_search.hpp"
#include "search/host_lookup.hpp"

namespace r4 {

// Throws Error{usage} for a URL that UDP does not take. A host whose claim yields listens at any
// free port, unless the URL names one.
std::unique_ptr<Carrier> make_udp_carrier(asio::io_context& io, const Url& url, Role role,
                                          Claim claim);

// The same with another lookup of names and another search for boards.
std::unique_ptr<Carrier> make_udp_carrier_with(asio::io_context& io, const Url& url, Role role,
                                               HostLookup lookup, BoardSearch search = {},
                                               Claim claim = std::make_shared<DeviceClaim>());

// The name by which programs share the path: the board, as the URL writes it, and the port of
// hosts.
ShareName udp_share_name(const Url& text);
// True if the port of hosts is any free port: each program has its own.
bool udp_has_own_port(const Url& text);

}  // namespace r4
