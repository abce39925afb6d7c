// SPDX-License-Identifier: GPL-3.0-or-later
// The board's wiring. Element n-1 is channel n. The addresses are those of the boot report (paper
// Figure 3); paper section 2 assigns the chips to the channels. The paper does not give lines and
// levels: those below are our plan. Compare them with your board's schematic before you power a
// motor.
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

// The PCA9685 allows at most 1526 Hz.
constexpr std::uint32_t drive_hz = 1000;
constexpr std::uint32_t servo_hz = 50;

// Duty and direction are neighbours, so one transfer changes both. Direction: high is forward.
template <Chip chip>
struct DriveLines {
  std::uint8_t pwm;
  std::uint8_t direction;
};
constexpr int drive_lines = 2;
constexpr DriveLines<Chip::osmc_pwm> osmc_lines[] = {{0, 1}, {2, 3}, {4, 5}, {6, 7}};
constexpr DriveLines<Chip::dhb12_pwm> dhb12_lines[] = {{0, 1}, {2, 3}, {4, 5}, {6, 7}};
#define R4_DRIVES(DRIVE) DRIVE(osmc) DRIVE(dhb12)

constexpr std::uint8_t servo_lines[servo_channels] = {0, 1, 2,  3,  4,  5,  6,  7,
                                                      8, 9, 10, 11, 12, 13, 14, 15};

// Output of the MCP4728 (0-3: A-D), bits of port A. Direction: high is forward; brake: high is on.
struct BldcLines {
  std::uint8_t speed;
  std::uint8_t direction;
  std::uint8_t brake;
};
constexpr BldcLines bldc_lines[bldc_channels] = {{0, 0, 1}, {1, 2, 3}, {2, 4, 5}, {3, 6, 7}};

// Bits of port B; high switches a relay on. Relay 1 belongs to the dead-man's handle.
constexpr std::uint8_t relay_bits[relay_channels] = {0, 1, 2, 3, 4, 5, 6, 7};

// The input's level (paper section 4.1, DMHSTA) that means held.
constexpr bool handle_held_level = true;

// Port A in the safe state: every brake on, direction as after power-up.
constexpr std::uint8_t brakes_on = 1U << bldc_lines[0].brake | 1U << bldc_lines[1].brake |
                                   1U << bldc_lines[2].brake | 1U << bldc_lines[3].brake;

}  // namespace firmware
}  // namespace r4
