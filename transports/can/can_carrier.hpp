// SPDX-License-Identifier: GPL-3.0-or-later
// can://INTERFACE[?node=1&fd=0&pack=1]: datagrams of one board on a CAN bus
// (docs/reference/can.md), by ISO-TP on SocketCAN. Several carriers may share an interface.
//     node=N   the board's number on the bus, 0-31 (default 1)
//     fd=1     sends CAN FD frames; receives classic and FD frames
//     pack=0   a host sends and gets text, not the packed form; both forms are received. A board
//              uses its setting instead: C:pack,0
// A host's Priority::stop is the emergency frame, which stops every board and overtakes all frames.
// A watcher's lease (W) is a separate frame, sent only while the board, but no host, is heard.
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
  std::uint8_t node = 1;
  bool fd = false;
  bool packs = true;  // for a host; a board uses its setting
  std::string name;
};

// open() calls `open_bus()`, which returns the bus or throws Error.
std::unique_ptr<Carrier> make_can_carrier_on(asio::io_context& io, CanCarrierOptions options,
                                             std::function<std::shared_ptr<CanBus>()> open_bus);

std::unique_ptr<Carrier> make_can_carrier(asio::io_context& io, const Url& url, Role role,
                                          const Claim& = {});

ShareName can_share_name(const Url& url);

}  // namespace r4
