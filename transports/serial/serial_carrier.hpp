// SPDX-License-Identifier: GPL-3.0-or-later
// Datagrams as lines on a serial port: the board's USB, or the pty of a simulated board.
//     serial:///dev/ttyACM0[?baud=1000000]   that device, or a link to one
//     serial:auto                            the one R4 board on USB (2341:0266)
//     serial:?sn=SERIAL                      the USB device with that serial number
// Rates below 9600 are refused: 1200 baud orders an Arduino to erase its program. If a port is
// unplugged, the carrier is `down` at once, and searches for the port by serial number or path.
#pragma once

#include <asio/io_context.hpp>
#include <memory>

#include "../share_name.hpp"
#include "r4link/carrier.hpp"
#include "r4link/discovery/url.hpp"

namespace r4 {

// Throws Error{usage} for a URL that serial refuses.
std::unique_ptr<Carrier> make_serial_carrier(asio::io_context& io, const Url& url, Role role,
                                             Claim claim);

// The name under which programs share the port: a board's serial number, so that the USB socket
// does not matter, or the path of another device. Throws Error if there is no device or several.
ShareName serial_share_name(const Url& url);

}  // namespace r4
