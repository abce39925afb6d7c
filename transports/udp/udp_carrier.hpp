// SPDX-License-Identifier: GPL-3.0-or-later
// Datagrams over UDP, one a packet, on the ports of the paper.
//
//     host    udp://HOST[:2018][?listen=2390]        sends to HOST:2018 from port 2390 and hears
//                                                    HOST there, from any of its ports; listen=0
//                                                    takes any free port. Boards of one program
//                                                    share the port (udp_host_socket.hpp).
//                                                    local=ADDRESS sends from that address of this
//                                                    computer, by its interface
//             udp:auto[?port=2018&listen=…]      the one board that is on the networks of this
//                                                computer (board_search.hpp)
//             udp:?id=NAME[&port=…&listen=…]     the board of that name, or of that board id
//     board   udp://BIND[:2018][?peer=HOST[:2390]]   port 0 takes any free port; name() tells it
//
// A board knows the last 16 hosts that sent a valid datagram, and the one in control in any case.
// A board with a peer sends to it what is for everyone; one without sends that to the host in
// control, else to the one heard last. An answer goes to where the question came from. The paper's
// Python client asks from a port at which it does not listen, so an answer to another port of the
// peer's address goes to the peer as well.
//
// A name is looked up in open(), IPv4 first. A host's open() within a handler of the loop does not
// wait for that: it is `down` until the name is known, asked for each second. A host that has heard
// nothing valid for 3 to 6 s looks again, and goes to where the board is then: so it does, too, where
// the board is searched for. What a search has found is that board until close(). A board that is off
// (port unreachable) is a quiet board, no failure; an unreachable network is: `down`, tried again
// five times a second.
#pragma once

#include <asio/io_context.hpp>
#include <memory>

#include "../share_name.hpp"
#include "../url.hpp"
#include "r4link/carrier.hpp"
#include "search/board_search.hpp"
#include "search/host_lookup.hpp"

namespace r4 {

// Throws Error{usage} for a URL that UDP does not take.
std::unique_ptr<Carrier> make_udp_carrier(asio::io_context& io, const Url& url, Role role);

// A host's, opened as `claim` says each time: for a program that watches at any free port, unless
// the URL names one.
std::unique_ptr<Carrier> make_claimed_udp_carrier(asio::io_context& io, const Url& url,
                                                  std::shared_ptr<DeviceClaim> claim);

// With names looked up and boards searched for in that way.
std::unique_ptr<Carrier> make_udp_carrier_with(asio::io_context& io, const Url& url, Role role,
                                               HostLookup lookup, BoardSearch search = {});

// What programs that share the path call it: the board, as it is written, and the port of hosts. Empty
// where that is any free one: then each has its own.
ShareName udp_share_name(const Url& text);
bool udp_has_own_port(const Url& text);

}  // namespace r4
