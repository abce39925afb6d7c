// SPDX-License-Identifier: GPL-3.0-or-later
// can://INTERFACE[?node=1&fd=0&pack=1]: datagrams of one board on a CAN bus (docs/can.md), by
// ISO-TP on SocketCAN, at either end. Several carriers may share an interface.
//
//     node=N   the board's number on the bus, 0-31 (default 1)
//     fd=1     sends CAN FD frames; receives classic and FD frames
//     pack=0   a host sends and gets text; without it, the packed form. Both forms are received. A
//              board follows its setting: C:pack,0
//
// A stop (Priority::stop) of the host's end is the emergency frame, which stops every board on the
// bus and overtakes all frames that wait. The lease (W) of a watcher is a frame of its own. It is
// sent only while the board is heard and no host is.
#pragma once

#include <asio/io_context.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "../share_name.hpp"
#include "r4link/carrier.hpp"
#include "r4link/discovery/url.hpp"

namespace r4 {

class CanBus;

struct CanCarrierOptions {
  Role role = Role::host;
  std::uint8_t node = 1;  // the board's number, 0-31
  bool fd = false;        // sends CAN FD frames
  bool packs = true;      // of a host; a board follows its setting
  std::string name;
};

// On the bus that `open_bus()` returns, which open() calls. It throws Error.
std::unique_ptr<Carrier> make_can_carrier_on(asio::io_context& io, CanCarrierOptions options,
                                             std::function<std::shared_ptr<CanBus>()> open_bus);

std::unique_ptr<Carrier> make_can_carrier(asio::io_context& io, const Url& url, Role role,
                                          const Claim& = {});

// The name by which programs share the path: the interface and the board's number.
ShareName can_share_name(const Url& url);

}  // namespace r4
