// SPDX-License-Identifier: GPL-3.0-or-later
// What the board has: channel counts, ranges and the small values that commands and state share
// (paper section 2; docs/protocol.md has the table).
#pragma once

#include <cstdint>

namespace r4 {

constexpr int osmc_channels = 4;
constexpr int dhb12_channels = 4;  // DHB1A DHB1B DHB2A DHB2B
constexpr int servo_channels = 16;
constexpr int relay_channels = 8;  // channel 1 is the dead-man's-handle relay
constexpr int stepper_channels = 4;
constexpr int encoder_channels = 4;
constexpr int bldc_channels = 4;
constexpr int ultrasonic_channels = 4;

constexpr std::int32_t pwm_max = 4095;             // 12 bit duty (PCA9685), DAC code (MCP4728)
constexpr std::int32_t servo_max_us = 2500;        // pulse width; 0 is off
constexpr std::int32_t stepper_speed_max = 20000;  // steps per second
constexpr std::int32_t stepper_speed_default = 1000;
constexpr std::int32_t proximity_max_cm = 400;  // HC-SR04 range; a threshold of 0 is off

enum class Direction : std::uint8_t { reverse = 0, forward = 1 };

// One H-bridge channel (OSMC or DHB12).
struct Drive {
  std::uint16_t pwm = 0;  // 0-4095
  Direction direction = Direction::reverse;
  friend bool operator==(Drive a, Drive b) { return a.pwm == b.pwm && a.direction == b.direction; }
  friend bool operator!=(Drive a, Drive b) { return !(a == b); }
};

// One brushless driver channel.
struct Bldc {
  std::uint16_t speed = 0;  // 0-4095
  Direction direction = Direction::reverse;
  bool brake = false;
  friend bool operator==(Bldc a, Bldc b) {
    return a.speed == b.speed && a.direction == b.direction && a.brake == b.brake;
  }
  friend bool operator!=(Bldc a, Bldc b) { return !(a == b); }
};

// Why the outputs are safe; the number is what the SAFE field carries.
enum class SafeReason : std::uint8_t {
  none = 0,
  link = 1,       // no valid host heartbeat within the timeout, or the transport is gone
  stop = 2,       // E:STOP, until E:CLEAR
  handle = 3,     // the dead-man's handle is released
  proximity = 4,  // an ultrasonic sensor sees something nearer than its threshold
  watchdog = 5,   // a duty of the board missed its deadline
  fault = 6,      // a chip stopped answering, or the firmware found itself broken
};
constexpr int safe_reason_count = 7;

// The reason of a number on the wire. One that is not known is taken for a fault.
constexpr SafeReason to_safe_reason(std::uint32_t number) {
  return number < static_cast<std::uint32_t>(safe_reason_count) ? static_cast<SafeReason>(number)
                                                                : SafeReason::fault;
}

// "none", "link", "stop", "handle", "proximity", "watchdog", "fault"; "unknown" for other numbers.
const char* to_text(SafeReason reason);

}  // namespace r4
