// SPDX-License-Identifier: GPL-3.0-or-later
// A recording as a transport: `replay:FILE[?speed=1&path=1&from=0]`.
//
//     speed   so many times as fast as it was, 0.01-1000
//     path    the number of the board in the recording
//     from    so many seconds of the recording are passed over; or the time at which it begins, in UTC:
//             2026-11-23T21:20:00
//
// What the board said comes again, damaged datagrams too, and that the transport went or came. What is sent goes
// nowhere: nobody obeys. When the recording has ended the transport is down, and stays so. The file is read on the
// loop, 16 KiB at a time.
#pragma once

#include <asio/io_context.hpp>
#include <memory>

#include "../../transports/url.hpp"
#include "r4link/carrier.hpp"

namespace r4 {

// Throws Error{usage} for a URL that replay does not take. open() throws Error for a file that is no recording, or
// has no such path.
std::unique_ptr<Carrier> make_replay_carrier(asio::io_context& io, const Url& url, Role role);

}  // namespace r4
