// SPDX-License-Identifier: GPL-3.0-or-later
// The R4 board. Nothing here needs to be changed: the network, the rates and the calibration are set
// over USB, for example
//
//     r4 send serial:auto C:network,MyNetwork
//     r4 send serial:auto C:password,MyPassword
//
// and the line `report` in the serial monitor tells how the board is. See docs/firmware.md.
#include <R4Link.h>

void setup() { R4Link.begin(); }

void loop() { R4Link.poll(); }
