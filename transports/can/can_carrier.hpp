// SPDX-License-Identifier: GPL-3.0-or-later
// can://INTERFACE[?node=1&fd=0&pack=1]: datagrams of one board on a CAN bus (docs/can.md), by
// ISO-TP on SocketCAN, at either end. Many may share an interface.
//
//     node=N   the board's number on the bus, 0-31 (default 1)
//     fd=1     sends CAN FD frames; received are both
//     pack=0   a host sends text, and is answered so; else the packed form. Received are both. A board
//              goes by its setting: C:pack,0
//
// A stop (Priority::stop) of the host's end is the emergency frame, which stops every board on the
// bus, ahead of all that waits. A lease (W) of who watches is a frame of its own, and only where the board is
// heard and no host.
#pragma once

#include <asio/io_context.hpp>
#include <memory>

#include "../share_name.hpp"
#include "../url.hpp"
#include "r4link/carrier.hpp"

namespace r4 {

std::unique_ptr<Carrier> make_can_carrier(asio::io_context& io, const Url& url, Role role);

// What programs that share the path call it: the interface and the board's number.
ShareName can_share_name(const Url& url);

}  // namespace r4
