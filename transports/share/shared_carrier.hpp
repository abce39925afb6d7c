// SPDX-License-Identifier: GPL-3.0-or-later
// A wire that the programs of a user share (docs/sharing.md): a carrier about the one that a URL names.
//
//                 nobody holds the wire                       a program that controls comes
//     attaching ------------------------> holding (the carrier is open) ---+
//      ^  |                                                                |
//      |  +--> sharing (what the holder tells)                             |
//      |          | the holder ends, or gives the wire away                |
//      +----------+--------------------------------------------------------+
//
// Who controls the board holds the wire itself: nothing of what it sends waits for another program, and
// none can hold it up. So a program that watches gives the wire to one that comes to control. Those
// that watch hear all that passes, and send stops.
#pragma once

#include <asio/io_context.hpp>
#include <memory>

#include "../shared_wire.hpp"
#include "r4link/carrier.hpp"
#include "r4link/options.hpp"

namespace r4 {

// What the carrier reports is what `own` does, whoever holds the wire. `claim`: by which `own`
// opens its device.
std::unique_ptr<Carrier> make_shared_carrier(asio::io_context& io, std::unique_ptr<Carrier> own,
                                             std::shared_ptr<DeviceClaim> claim, FindWire find,
                                             BoardRole role);

}  // namespace r4
