// SPDX-License-Identifier: GPL-3.0-or-later
// The firmware of the R4 board, for a sketch on the Arduino Giga R1 WiFi:
//
//     #include <R4Link.h>
//     void setup() { R4Link.begin(); }
//     void loop() { R4Link.poll(); }
//
// That is the whole sketch: what the board is to do is said over USB, WiFi or CAN, and how it is wired
// and reached is set over USB (docs/firmware.md). What a sketch does besides must be done within
// milliseconds: a loop that stays away for 20 ms counts as a missed deadline, one that stays away
// longer makes the outputs safe, and 400 ms end in a reset.
#pragma once

#if !defined(ARDUINO_GIGA) && !defined(TARGET_GIGA)
#error "R4 Link is for the Arduino Giga R1 WiFi: choose it as the board"
#endif
#ifdef CORE_CM4  // ARDUINO_GIGA is defined for either
#error "R4 Link is for the main core of the Giga (Tools > Target core)"
#endif

namespace r4 {
namespace giga {

class Sketch {
 public:
  // First of all in setup(). All outputs are off when it returns, after half a second or so.
  void begin();
  // In loop(): a turn of the board; rests until there is work, two milliseconds at most.
  void poll();
};

}  // namespace giga
}  // namespace r4

extern r4::giga::Sketch R4Link;  // NOLINT(readability-identifier-naming): as libraries are named
