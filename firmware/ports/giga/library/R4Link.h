// SPDX-License-Identifier: GPL-3.0-or-later
// The firmware of the R4 board as a library for the Arduino Giga R1 WiFi: R4Link.begin() in setup(),
// R4Link.poll() in loop().
#pragma once

#include "firmware/ports/giga/sketch.hpp"
