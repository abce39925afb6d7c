// SPDX-License-Identifier: GPL-3.0-or-later
// A transport that a user's programs share (docs/how-to/sharing.md). Wraps the carrier of a URL.
//     seeking ----a program holds it----> asking ----welcome----> joined
//      |   ^                                |                       |
//      |   +---- the holder ends, or does not answer in time -------+
//      |   |
//      |   +---- a controlling program asks for the transport, or takes it; or the role changes
//      |   |
//      +-> holding, with the carrier open: no program holds it, or the holder was passed over
// The controlling program holds the transport, so its datagrams never wait for another program. The
// program also has a separate name, so a second controlling program is refused at once. Watching
// programs receive all datagrams, and send stops. A program that takes control first takes the
// separate name; if refused, nothing changes. Then the program reopens the transport, because
// control needs another DeviceClaim, and the served programs seek the holder again.
#pragma once

#include <asio/io_context.hpp>
#include <memory>

#include "../share_name.hpp"
#include "r4link/carrier.hpp"
#include "r4link/options.hpp"

namespace r4 {

// Reports the same as `own`, whichever program holds the transport. open() does not wait. open()
// throws Error{refused} if another program controls the board, or an error of `own`.
std::unique_ptr<Carrier> make_shared_carrier(asio::io_context& io, std::unique_ptr<Carrier> own,
                                             Claim claim, FindShareName find, BoardRole role);

}  // namespace r4
