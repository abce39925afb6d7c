// SPDX-License-Identifier: GPL-3.0-or-later
// Which chip and line of the board serves which channel: the one place where it is said.
//
// The addresses are those of the boot report (paper Figure 3); that the three PCA9685 serve OSMC,
// DHB12 and servos, that port A of the MCP23017 carries direction and brake of the BLDC channels
// and port B the relays, and that the MCP4728 carries their speed, is the paper's (section 2). It
// does not say which line is which: the lines below are our plan, in the order of the channels, and
// so are the levels. Compare them with the schematic of the board in hand before power is applied
// to a motor.
//
// Element n-1 is channel n.
#pragma once

#include <cstdint>

#include "r4link/vocabulary.hpp"

namespace r4 {
namespace firmware {

constexpr std::uint8_t expander_address = 0x20;   // MCP23017
constexpr std::uint8_t osmc_pwm_address = 0x40;   // PCA9685
constexpr std::uint8_t dhb12_pwm_address = 0x41;  // PCA9685
constexpr std::uint8_t servo_pwm_address = 0x42;  // PCA9685
constexpr std::uint8_t dac_address = 0x61;        // MCP4728

enum class Chip : std::uint8_t { osmc_pwm, dhb12_pwm, expander, dac, servo_pwm, count };
constexpr int chip_count = static_cast<int>(Chip::count);

// The frequency of the pulses. The PCA9685 ends at 1526 Hz.
constexpr std::uint32_t drive_hz = 1000;
constexpr std::uint32_t servo_hz = 50;

// An H-bridge: outputs of its PCA9685. Duty and direction are neighbours: they change in one
// transfer. Direction: high is forward.
template <Chip chip>
struct DriveLines {
  std::uint8_t pwm;
  std::uint8_t direction;
};
constexpr int drive_lines = 2;
constexpr DriveLines<Chip::osmc_pwm> osmc_lines[] = {{0, 1}, {2, 3}, {4, 5}, {6, 7}};
constexpr DriveLines<Chip::dhb12_pwm> dhb12_lines[] = {{0, 1}, {2, 3}, {4, 5}, {6, 7}};
// The kinds of H-bridges.
#define R4_DRIVES(DRIVE) DRIVE(osmc) DRIVE(dhb12)

// A servo: output of its PCA9685.
constexpr std::uint8_t servo_lines[servo_channels] = {0, 1, 2,  3,  4,  5,  6,  7,
                                                      8, 9, 10, 11, 12, 13, 14, 15};

// A brushless driver: output of the MCP4728 (0-3 for A-D) and bits of port A. Direction: high is
// forward; brake: high brakes.
struct BldcLines {
  std::uint8_t speed;
  std::uint8_t direction;
  std::uint8_t brake;
};
constexpr BldcLines bldc_lines[bldc_channels] = {{0, 0, 1}, {1, 2, 3}, {2, 4, 5}, {3, 6, 7}};

// A relay: bit of port B; high switches it on. Relay 1 is the dead-man's handle's.
constexpr std::uint8_t relay_bits[relay_channels] = {0, 1, 2, 3, 4, 5, 6, 7};

// The handle's input (paper section 4.1, DMHSTA): the level that means held.
constexpr bool handle_held_level = true;

// Port A in the safe state: every brake on, direction as after power-up.
constexpr std::uint8_t brakes_on = 1U << bldc_lines[0].brake | 1U << bldc_lines[1].brake |
                                   1U << bldc_lines[2].brake | 1U << bldc_lines[3].brake;

}  // namespace firmware
}  // namespace r4
