// SPDX-License-Identifier: GPL-3.0-or-later
// The Giga's pins that no wiring can change, with the names printed on it, and the pin of a place.
#pragma once

#include <cstdint>

#include "../../../protocol/wiring/giga_pins.hpp"
#include "chip/gpio.hpp"
#include "r4link/wiring/wiring.hpp"

namespace r4 {
namespace giga {

// `place` must be connected to a pin.
inline Pin pin_of(Place place) {
  const GigaPin& pin = giga_pins[place.number()];
  return {pin.port, pin.number};
}
inline Line line_of(Place place) {
  return place.connected() ? line_of(pin_of(place)) : unconnected_line();
}

// I2C2 (SCL D21, SDA D20), and I2C4, which is the core's Wire1 (SCL1, SDA1).
constexpr Pin i2c_scl_pins[] = {{'H', 4}, {'B', 6}};
constexpr Pin i2c_sda_pins[] = {{'B', 11}, {'H', 12}};
constexpr std::uint32_t i2c_scl_functions[] = {4, 6};
constexpr std::uint32_t i2c_sda_functions[] = {4, 4};

// USART2 and UART4 for the user (the core's Serial2 and Serial3).
constexpr Pin uart_tx_pins[uart_channels] = {{'D', 5}, {'H', 13}};  // D18 D16
constexpr Pin uart_rx_pins[uart_channels] = {{'D', 6}, {'I', 9}};   // D19 D17
constexpr std::uint32_t uart_functions[uart_channels] = {7, 8};

constexpr Pin dac_pins[dac_channels] = {{'A', 4}, {'A', 5}};  // A12 A13

// FDCAN2, for the R4 board's transceiver SN65HVD230 (paper, section 2; docs/how-to/can.md).
constexpr Pin can_tx_pin = {'B', 13};
constexpr Pin can_rx_pin = {'B', 5};
constexpr std::uint32_t can_function = 9;

// The lights are on when their pins are low.
constexpr Pin red_led_pin = {'I', 12};
constexpr Pin green_led_pin = {'J', 13};
constexpr Pin blue_led_pin = {'E', 3};

}  // namespace giga
}  // namespace r4
