// SPDX-License-Identifier: GPL-3.0-or-later
// Keeps the board able to send over USB. If a program closes the port while a packet is under way,
// the core closes the endpoint that sends (mbed-os issue 13215). Only SET_CONFIGURATION opens it
// again, which a computer sends when it finds the board: the next program would receive nothing.
#pragma once

namespace r4 {
namespace giga {

// Call it in each turn of the loop. Opens the endpoint again if the core has closed it (RM0399,
// chapter OTG_HS: DIEPCTL), and forgets the packet that was under way. True if it opened the
// endpoint: a program has closed the port, even if the next program has opened it since.
bool keep_usb_sending();

}  // namespace giga
}  // namespace r4
