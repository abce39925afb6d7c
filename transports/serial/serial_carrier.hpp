// SPDX-License-Identifier: GPL-3.0-or-later
// Datagrams as lines on a serial port: the board's USB, or the pty of a simulated board.
//
//     serial:///dev/ttyACM0[?baud=1000000]   that device, or a link to one
//     serial:auto                            the one R4 board on USB (2341:0266)
//     serial:?sn=SERIAL                      the USB device with that serial number
//
// 8N1, raw, no flow control, locked. Rates below 9600 are refused: an Arduino takes 1200 baud as
// the order to erase its program. An unplugged or hung-up port is `down` at once. The carrier looks
// for it until it is back, by serial number where it has one, else by its path.
#pragma once

#include <asio/io_context.hpp>
#include <memory>

#include "../share_name.hpp"
#include "r4link/carrier.hpp"
#include "r4link/discovery/url.hpp"

namespace r4 {

// Throws Error{usage} for a URL that serial does not take.
std::unique_ptr<Carrier> make_serial_carrier(asio::io_context& io, const Url& url, Role role,
                                             Claim claim);

// The name by which programs share the port: that of a board is its serial number, so that it may
// be plugged into another socket; that of any other device is its path. Throws Error where there is
// no device, or more than one.
ShareName serial_share_name(const Url& url);

}  // namespace r4
