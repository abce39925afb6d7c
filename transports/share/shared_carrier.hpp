// SPDX-License-Identifier: GPL-3.0-or-later
// A transport that the programs of a user share (docs/sharing.md): a carrier about the one that a
// URL names.
//
//     seeking ----a program holds it----> asking ----welcome----> joined
//      |   ^                                |                       |
//      |   +---- the holder ends, or does not answer in time -------+
//      |   |
//      |   +---- a program that controls asks for the transport, or takes it; the role is another
//      |   |
//      +-> holding, with the carrier open: no program holds it, or the holder was passed over
//
// The program that controls the board holds the transport itself: nothing of what it sends waits
// for another program. It also holds a name of its own, so a second one is refused at once.
// Programs that watch hear all that passes, and send stops.
//
// A program that takes control takes that name first: if it is refused, all stays as it is. Then,
// as with any holder that ends, the transport is opened again, since a program that controls opens
// it in another way (DeviceClaim), and the programs that it served look for the holder again.
#pragma once

#include <asio/io_context.hpp>
#include <memory>

#include "../share_name.hpp"
#include "r4link/carrier.hpp"
#include "r4link/options.hpp"

namespace r4 {

// What the carrier reports is what `own` does, whichever program holds the transport. `claim`: how
// `own` opens its device. open() does not wait for another program; it throws Error{refused} if one
// controls the board, and what `own` throws.
std::unique_ptr<Carrier> make_shared_carrier(asio::io_context& io, std::unique_ptr<Carrier> own,
                                             std::shared_ptr<DeviceClaim> claim, FindShareName find,
                                             BoardRole role);

}  // namespace r4
