// SPDX-License-Identifier: GPL-3.0-or-later
// A recording as a transport: `replay:FILE[?speed=1&path=1&from=0]`.
//
//     speed   how many times as fast as recorded, 0.01-1000
//     path    the number of the path in the recording
//     from    how many seconds of the recording are skipped; or the UTC time at which the replay
//             begins: 2026-11-23T21:20:00
//
// Replays the datagrams of the board, also damaged ones, and the ups and downs of its transport.
// What is sent is dropped: a recording obeys no command. After the end of the recording the
// transport is down, and stays down. The file is read on the loop, 16 KiB at a time.
#pragma once

#include <asio/io_context.hpp>
#include <memory>

#include "r4link/carrier.hpp"
#include "r4link/discovery/url.hpp"

namespace r4 {

// Throws Error{usage} for a wrong URL. open() throws Error for a file that is not a recording, or
// has no such path.
std::unique_ptr<Carrier> make_replay_carrier(asio::io_context& io, const Url& url, Role role);

}  // namespace r4
