// SPDX-License-Identifier: GPL-3.0-or-later
// The firmware of the R4 board as an Arduino library for the Giga R1 WiFi.
#pragma once

#include "firmware/ports/giga/sketch.hpp"
