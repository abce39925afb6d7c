// SPDX-License-Identifier: GPL-3.0-or-later
// The pins D0-D102 of the Arduino Giga R1 (the core's variants/GIGA/variant.cpp) and their other
// users. A8-A11 have no D number. Pin n of each port has interrupt line n (RM0399, chapter EXTI).
#pragma once

#include <cstdint>

namespace r4 {

// A pin with a user cannot serve a signal.
enum class PinUser : std::uint8_t {
  none,
  divider,  // resistors hold the pin at half the supply
  i2c,      // the two I2C buses
  uart,     // the user's UARTs
  dac,      // the user's voltages
  light,
  can,
  usb,  // the supply of the USB host port
  wifi,
  bluetooth,
  boot,
};

struct GigaPin {
  char port;
  std::uint8_t number;
  PinUser user;
};

constexpr GigaPin giga_pins[] = {
    {'B', 7, PinUser::none},      {'A', 9, PinUser::none},        // D0 D1
    {'A', 3, PinUser::none},      {'A', 2, PinUser::none},        // D2 D3
    {'J', 8, PinUser::none},      {'A', 7, PinUser::none},        // D4 D5
    {'D', 13, PinUser::none},     {'B', 4, PinUser::divider},     // D6 D7
    {'B', 8, PinUser::none},      {'B', 9, PinUser::none},        // D8 D9
    {'K', 1, PinUser::none},      {'J', 10, PinUser::none},       // D10 D11
    {'J', 11, PinUser::none},     {'H', 6, PinUser::none},        // D12 D13
    {'G', 14, PinUser::none},     {'C', 7, PinUser::none},        // D14 D15
    {'H', 13, PinUser::uart},     {'I', 9, PinUser::uart},        // D16 D17
    {'D', 5, PinUser::uart},      {'D', 6, PinUser::uart},        // D18 D19
    {'B', 11, PinUser::i2c},      {'H', 4, PinUser::i2c},         // D20 SDA, D21 SCL
    {'J', 12, PinUser::none},     {'G', 13, PinUser::none},       // D22 D23
    {'G', 12, PinUser::none},     {'J', 0, PinUser::none},        // D24 D25
    {'J', 14, PinUser::none},     {'J', 1, PinUser::none},        // D26 D27
    {'J', 15, PinUser::none},     {'J', 2, PinUser::none},        // D28 D29
    {'K', 3, PinUser::none},      {'J', 3, PinUser::none},        // D30 D31
    {'K', 4, PinUser::none},      {'J', 4, PinUser::none},        // D32 D33
    {'K', 5, PinUser::none},      {'J', 5, PinUser::none},        // D34 D35
    {'K', 6, PinUser::none},      {'J', 6, PinUser::none},        // D36 D37
    {'J', 7, PinUser::none},      {'I', 14, PinUser::none},       // D38 D39
    {'E', 6, PinUser::none},      {'K', 7, PinUser::none},        // D40 D41
    {'I', 15, PinUser::none},     {'I', 10, PinUser::none},       // D42 D43
    {'G', 10, PinUser::none},     {'I', 13, PinUser::none},       // D44 D45
    {'H', 15, PinUser::none},     {'B', 2, PinUser::none},        // D46 D47
    {'K', 0, PinUser::none},      {'E', 4, PinUser::none},        // D48 D49
    {'I', 11, PinUser::none},     {'E', 5, PinUser::none},        // D50 D51
    {'K', 2, PinUser::none},      {'G', 7, PinUser::none},        // D52 D53
    {'I', 5, PinUser::none},      {'H', 8, PinUser::none},        // D54 D55
    {'A', 6, PinUser::none},      {'J', 9, PinUser::none},        // D56 D57
    {'I', 7, PinUser::none},      {'I', 6, PinUser::none},        // D58 D59
    {'I', 4, PinUser::none},      {'H', 14, PinUser::none},       // D60 D61
    {'G', 11, PinUser::none},     {'H', 11, PinUser::none},       // D62 D63
    {'H', 10, PinUser::none},     {'H', 9, PinUser::none},        // D64 D65
    {'A', 1, PinUser::none},      {'D', 4, PinUser::none},        // D66 D67
    {'C', 6, PinUser::none},      {'I', 0, PinUser::none},        // D68 D69
    {'I', 1, PinUser::none},      {'I', 2, PinUser::none},        // D70 D71
    {'I', 3, PinUser::none},      {'C', 1, PinUser::none},        // D72 D73
    {'B', 12, PinUser::none},     {'D', 3, PinUser::none},        // D74 D75
    {'C', 4, PinUser::none},      {'C', 5, PinUser::none},        // D76 D77: A0 A1
    {'B', 0, PinUser::none},      {'B', 1, PinUser::none},        // D78 D79: A2 A3
    {'C', 3, PinUser::none},      {'C', 2, PinUser::none},        // D80 D81: A4 A5
    {'C', 0, PinUser::none},      {'A', 0, PinUser::none},        // D82 D83: A6 A7
    {'A', 4, PinUser::dac},       {'A', 5, PinUser::dac},         // D84 D85: A12 A13
    {'I', 12, PinUser::light},    {'J', 13, PinUser::light},      // D86 D87
    {'E', 3, PinUser::light},     {'G', 9, PinUser::none},        // D88 D89
    {'D', 7, PinUser::none},      {'B', 3, PinUser::none},        // D90 D91
    {'A', 15, PinUser::usb},      {'B', 5, PinUser::can},         // D92, D93 CANRX
    {'B', 13, PinUser::can},      {'I', 8, PinUser::wifi},        // D94 CANTX, D95
    {'B', 10, PinUser::wifi},     {'H', 7, PinUser::bluetooth},   // D96 D97
    {'G', 3, PinUser::bluetooth}, {'A', 10, PinUser::bluetooth},  // D98 D99
    {'C', 13, PinUser::boot},     {'B', 6, PinUser::i2c},         // D100 BOOT0, D101 SCL1
    {'H', 12, PinUser::i2c},                                      // D102 SDA1
};
constexpr int giga_pin_count = sizeof giga_pins / sizeof *giga_pins;
static_assert(giga_pin_count == 103, "as in the core");

// A0-A7, with the inputs of ADC1 (RM0399, and PeripheralPins.c of the core).
constexpr int first_analog_pin = 76;
constexpr std::uint8_t adc1_inputs[] = {4, 8, 9, 5, 13, 12, 10, 16};
constexpr int analog_pin_count = sizeof adc1_inputs;

// The interrupt line of PI8, by which the WiFi chip wakes the core.
constexpr std::uint8_t wifi_interrupt_line = 8;

}  // namespace r4
