// SPDX-License-Identifier: GPL-3.0-or-later
// A transport that the programs of a user share (docs/sharing.md): a carrier that wraps the carrier
// of a URL.
//
//     seeking ----a program holds it----> asking ----welcome----> joined
//      |   ^                                |                       |
//      |   +---- the holder ends, or does not answer in time -------+
//      |   |
//      |   +---- a program that controls asks for the transport, or takes it; the role is another
//      |   |
//      +-> holding, with the carrier open: no program holds it, or the holder was passed over
//
// The program that controls the board holds the transport itself: its datagrams never wait for
// another program. It also holds a name of its own, so a second one is refused at once. Programs
// that watch hear all datagrams, and send stops.
//
// A program that takes control takes that name first. If it is refused, nothing changes. Else the
// transport is opened again, because a program that controls opens it in another way (DeviceClaim).
// The programs that it served look for the holder again, as they do whenever a holder ends.
#pragma once

#include <asio/io_context.hpp>
#include <memory>

#include "../share_name.hpp"
#include "r4link/carrier.hpp"
#include "r4link/options.hpp"

namespace r4 {

// The carrier reports the same as `own`, whichever program holds the transport. `claim`: how `own`
// opens its device. open() does not wait for another program. It throws Error{refused} if another
// program controls the board, and what `own` throws.
std::unique_ptr<Carrier> make_shared_carrier(asio::io_context& io, std::unique_ptr<Carrier> own,
                                             Claim claim, FindShareName find, BoardRole role);

}  // namespace r4
