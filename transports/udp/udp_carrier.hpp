// SPDX-License-Identifier: GPL-3.0-or-later
// Datagrams over UDP, one a packet, on the ports of the paper.
//     host   udp://HOST[:2018]                      sends to HOST:2018, hears all ports of HOST
//            udp:auto                               the only board on this computer's networks
//            udp:?id=NAME                           the board of that name or board id
//     board  udp://BIND[:2018][?peer=HOST[:2390]]   port 0: any free port, which name() shows
// Options of a host: listen=2390 is its port, which the boards of one program share
// (udp_host_socket.hpp); 0: any free port. With HOST, local=ADDRESS sends from that address of this
// computer, by its interface. In a search (board_search.hpp), port=2018 is the boards' port.
// A board keeps the last 16 hosts that sent a valid datagram, and always the controlling host.
// Datagrams for everyone go to the peer in the URL, else to the controlling host, else to the host
// heard last. An answer goes to the sender of the question, and also to a peer at the same address,
// because the paper's Python client does not listen at the port from which it sends.
// open() looks a name up. Within a handler of the loop a host's open() does not wait. The host is
// `down` until the name is known, and repeats the lookup each second. If a host hears nothing valid
// for 3 to 6 s, it repeats the lookup or search, and follows the board. The board that a search
// found stays the wanted board until close(). A board that is off (port unreachable) counts as
// silent. If the network is unreachable, the host is `down` and tries again five times a second.
#pragma once

#include <asio/io_context.hpp>
#include <memory>

#include "../share_name.hpp"
#include "r4link/carrier.hpp"
#include "r4link/discovery/url.hpp"

namespace r4 {

// Throws Error{usage} for a wrong URL. If the URL has no port, a host that yields takes any free
// port.
std::unique_ptr<Carrier> make_udp_carrier(asio::io_context& io, const Url& url, Role role,
                                          Claim claim);

// The name under which programs share the path: the board as in the URL, and the port of hosts.
ShareName udp_share_name(const Url& text);
// True if the URL lets each program use a free port of its own.
bool udp_has_own_port(const Url& text);

}  // namespace r4
