// SPDX-License-Identifier: GPL-3.0-or-later
// The parts of ArduinoCore-mbed 4.6.0 and ArduinoCore-API 1.5.2 that the firmware uses: our own
// declarations, and the macros of the original. The macros can break any header that is included
// after them.
#pragma once

#include <cstddef>
#include <cstdint>

#include "mbed.h"

#define abs(x) ((x) > 0 ? (x) : -(x))
#define min(a, b) ((a) < (b) ? (a) : (b))
#define max(a, b) ((a) > (b) ? (a) : (b))
#define round(x) ((x) >= 0 ? (long)((x) + 0.5) : (long)((x)-0.5))
#define radians(deg) ((deg)*DEG_TO_RAD)
#define degrees(rad) ((rad)*RAD_TO_DEG)
#define sq(x) ((x) * (x))
#define bit(b) (1UL << (b))
#define bitRead(value, bit) (((value) >> (bit)) & 0x01)
#define bitSet(value, bit) ((value) |= (1UL << (bit)))
#define bitClear(value, bit) ((value) &= ~(1UL << (bit)))
#define bitToggle(value, bit) ((value) ^= (1UL << (bit)))
#define bitWrite(value, bit, bitvalue) \
  ((bitvalue) ? bitSet((value), (bit)) : bitClear((value), (bit)))
#define word(...) makeWord(__VA_ARGS__)
#define lowByte(w) ((uint8_t)((w)&0xff))
#define highByte(w) ((uint8_t)((w) >> 8))
#define constrain(amt, low, high) ((amt) < (low) ? (low) : ((amt) > (high) ? (high) : (amt)))
#define interrupts() __enable_irq()
#define noInterrupts() __disable_irq()
#define PI 3.1415926535897932384626433832795
#define HALF_PI 1.5707963267948966192313216916398
#define TWO_PI 6.283185307179586476925286766559
#define DEG_TO_RAD 0.017453292519943295769236907684886
#define RAD_TO_DEG 57.295779513082320876798154814105
#define EULER 2.718281828459045235360287471352
#define SERIAL 0x0
#define DISPLAY 0x1
#define F(text) (text)
#define B0 0
#define B1 1
#define D0 (0u)
#define LED1 LED_RED
#define Serial _UART_USB_

using boolean = bool;
using byte = std::uint8_t;
using word = std::uint16_t;

void setup();
void loop();

namespace arduino {

class IPAddress {
 public:
  IPAddress() = default;
  IPAddress(std::uint8_t a, std::uint8_t b, std::uint8_t c, std::uint8_t d) : bytes_{a, b, c, d} {}
  IPAddress(std::uint32_t address);  // NOLINT
  operator std::uint32_t() const;    // NOLINT
  std::uint8_t operator[](int index) const { return bytes_[index]; }
  std::uint8_t& operator[](int index) { return bytes_[index]; }

 private:
  std::uint8_t bytes_[4] = {};
};

}  // namespace arduino

using namespace arduino;  // NOLINT: as the original does
