// SPDX-License-Identifier: GPL-3.0-or-later
// The firmware of the R4 board, for a sketch on the Arduino Giga R1 WiFi:
//     #include <R4Link.h>
//     void setup() { R4Link.begin(); }
//     void loop() { R4Link.poll(); }
//
// The board is commanded over USB, WiFi or CAN and configured over USB (docs/how-to/firmware.md).
// Other code in the sketch must finish within milliseconds. A turn of the loop longer than 20 ms
// misses a deadline, a longer turn makes the outputs safe, and after 400 ms the board resets.
#pragma once

#if !defined(ARDUINO_GIGA) && !defined(TARGET_GIGA)
#error "R4 Link is for the Arduino Giga R1 WiFi: choose it as the board"
#endif
#ifdef CORE_CM4  // ARDUINO_GIGA is defined for both cores
#error "R4 Link is for the main core of the Giga (Tools > Target core)"
#endif

namespace r4 {
namespace giga {

class Sketch {
 public:
  void begin();  // first in setup(); returns after about 0.5 s, with all outputs off
  // Call in loop(). One turn of the board, then rests until there is work, at most 2 ms.
  void poll();
};

}  // namespace giga
}  // namespace r4

extern r4::giga::Sketch R4Link;  // NOLINT(readability-identifier-naming): usual for libraries
