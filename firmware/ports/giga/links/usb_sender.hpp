// SPDX-License-Identifier: GPL-3.0-or-later
// Keeps the board able to send over USB. If a program closes the port while a packet is under way,
// the core closes the endpoint that sends (mbed-os issue 13215). Only SET_CONFIGURATION reopens it,
// which the USB host sends when it finds the board. So the next program would receive nothing.
#pragma once

namespace r4 {
namespace giga {

// Call in each turn of the loop. If the core has closed the endpoint (RM0399, chapter OTG_HS:
// DIEPCTL), reopens it and drops the packet under way. True then: a program has closed the port.
bool keep_usb_sending();

}  // namespace giga
}  // namespace r4
