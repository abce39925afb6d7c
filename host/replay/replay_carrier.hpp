// SPDX-License-Identifier: GPL-3.0-or-later
// A recording as a transport: `replay:FILE[?speed=1&path=1&from=0]`.
//     speed   speed factor, 0.01-1,000,000
//     path    number of the path in the recording
//     from    seconds of the recording to skip, or a UTC time: 2026-11-23T21:20:00
//
// Replays the board's datagrams, also damaged datagrams, and its transport's `up` and `down`. Drops
// sent datagrams. After the end the transport stays down. Reads on the loop, 16 KiB at a time.
#pragma once

#include <asio/io_context.hpp>
#include <memory>

#include "r4link/carrier.hpp"
#include "r4link/discovery/url.hpp"

namespace r4 {

// Throws Error{usage} for a wrong URL. open() throws Error for an invalid file or a missing path.
std::unique_ptr<Carrier> make_replay_carrier(asio::io_context& io, const Url& url, Role role);

}  // namespace r4
