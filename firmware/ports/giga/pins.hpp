// SPDX-License-Identifier: GPL-3.0-or-later
// The only table of which pin of the Giga serves which channel. The paper does not name the pins,
// so this plan is ours. Compare it with the schematic of the board before you power a motor.
// Element n-1 is channel n; comments give the names printed on the Giga. Pin number n of every port
// uses interrupt line n, so two pins with the same number cannot both interrupt (RM0399, chapter
// EXTI). Line 8 belongs to WiFi (PI8). Encoder pins A and B and the echo pins interrupt; index pins
// are sampled.
#pragma once

#include <cstdint>

#include "chip/gpio.hpp"

namespace r4 {
namespace giga {

constexpr Pin step_pins[stepper_channels] = {{'A', 3}, {'A', 2}, {'J', 8}, {'A', 7}};  // D2-D5
constexpr Pin direction_pins[stepper_channels] = {
    {'K', 5}, {'K', 6}, {'E', 6}, {'K', 7}};  // D34 D36 D40 D41

constexpr Pin trigger_pins[ultrasonic_channels] = {
    {'I', 14}, {'H', 15}, {'G', 12}, {'I', 13}};  // D39 D46 D24 D45
constexpr Pin echo_pins[ultrasonic_channels] = {
    {'I', 10}, {'I', 11}, {'J', 12}, {'G', 13}};  // D43 D50 D22 D23

constexpr Pin encoder_a_pins[encoder_channels] = {
    {'J', 0}, {'J', 2}, {'J', 4}, {'J', 6}};  // D25 D29 D33 D37
constexpr Pin encoder_b_pins[encoder_channels] = {
    {'J', 1}, {'J', 3}, {'J', 5}, {'J', 7}};  // D27 D31 D35 D38
constexpr Pin index_pins[encoder_channels] = {
    {'J', 14}, {'J', 15}, {'K', 3}, {'K', 4}};  // D26 D28 D30 D32

// Dead-man's handle: high while held. A broken wire reads as released.
constexpr Pin handle_pin = {'I', 15};  // D42

// In the order of r4link/state.hpp: AIN24 AIN12 AIN5 AINDMH AINSTEER AIN6.
constexpr Pin analog_pins[analog_channels] = {{'C', 4}, {'C', 5}, {'B', 0},
                                              {'B', 1}, {'C', 3}, {'C', 2}};  // A0-A5
constexpr std::uint32_t adc_inputs[analog_channels] = {4, 8, 9, 5, 13, 12};

// I2C2 for the chips: SCL and SDA (D21, D20), alternate function 4.
constexpr Pin i2c_scl_pin = {'H', 4};
constexpr Pin i2c_sda_pin = {'B', 11};
constexpr std::uint32_t i2c_function = 4;

// I2C4 for the user (the core's Wire1): SCL1 and SDA1.
constexpr Pin user_scl_pin = {'B', 6};
constexpr Pin user_sda_pin = {'H', 12};
constexpr std::uint32_t user_scl_function = 6;
constexpr std::uint32_t user_sda_function = 4;

// USART2 and UART4 for the user (the core's Serial2 and Serial3).
constexpr Pin uart_tx_pins[uart_channels] = {{'D', 5}, {'H', 13}};  // D18 D16
constexpr Pin uart_rx_pins[uart_channels] = {{'D', 6}, {'I', 9}};   // D19 D17
constexpr std::uint32_t uart_functions[uart_channels] = {7, 8};

constexpr Pin dac_pins[dac_channels] = {{'A', 4}, {'A', 5}};  // A12 A13

// D7 stands at half the supply on the Giga, so it cannot be an input with a pull-up.
constexpr Pin gpio_pins[gpio_channels] = {
    {'D', 13}, {'G', 10}, {'B', 8},  {'B', 9},
    {'K', 1},  {'J', 10}, {'J', 11}, {'H', 6}};  // D6 D44 D8-D13, pulled up

// FDCAN2, alternate function 9. The Giga has no transceiver: wire the SN65HVD230 of the R4 board
// (paper, section 2) to these pins (docs/how-to/can.md).
constexpr Pin can_tx_pin = {'B', 13};
constexpr Pin can_rx_pin = {'B', 5};
constexpr std::uint32_t can_function = 9;

// Lit when low.
constexpr Pin red_led_pin = {'I', 12};
constexpr Pin green_led_pin = {'J', 13};
constexpr Pin blue_led_pin = {'E', 3};

namespace pin_plan {

constexpr std::uint32_t wifi_line = 1U << 8;

template <int n>
constexpr std::uint32_t lines_of(const Pin (&pins)[n]) {
  std::uint32_t lines = 0;
  for (const Pin& pin : pins) lines |= 1U << pin.number;
  return lines;
}

constexpr int count_of(std::uint32_t lines) {
  int count = 0;
  for (; lines != 0; lines &= lines - 1) ++count;
  return count;
}

static_assert(count_of(lines_of(encoder_a_pins) | lines_of(encoder_b_pins) | lines_of(echo_pins) |
                       wifi_line) == 2 * encoder_channels + ultrasonic_channels + 1,
              "two pins share an interrupt line");

}  // namespace pin_plan

}  // namespace giga
}  // namespace r4
