// SPDX-License-Identifier: GPL-3.0-or-later
// The R4 board. You need not change this sketch. Set network, rates and calibration over USB:
//
//     r4 send serial:auto C:network,MyNetwork
//     r4 send serial:auto C:password,MyPassword
//
// Send the line `report` in the serial monitor to see the board's condition (docs/how-to/firmware.md).
#include <R4Link.h>

void setup() { R4Link.begin(); }

void loop() { R4Link.poll(); }
