// SPDX-License-Identifier: GPL-3.0-or-later
// The counts and ranges of a board's channels (paper section 2; table in
// docs/reference/protocol.md), and small types of commands, states and the link.
#pragma once

#include <cstdint>

#include "config.hpp"
#include "text.hpp"

namespace r4 {

constexpr int osmc_channels = 4;
constexpr int dhb12_channels = 4;  // DHB1A DHB1B DHB2A DHB2B
constexpr int servo_channels = 16;
constexpr int relay_channels = 8;  // relay 1 is the dead-man's-handle relay
constexpr int stepper_channels = 4;
constexpr int encoder_channels = 4;
constexpr int bldc_channels = 4;
constexpr int ultrasonic_channels = 4;

constexpr std::int32_t pwm_max = 4095;             // 12 bit duty (PCA9685), DAC code (MCP4728)
constexpr std::int32_t servo_max_us = 2500;        // pulse width; 0: off
constexpr std::int32_t stepper_speed_max = 20000;  // steps per second
constexpr std::int32_t stepper_speed_default = 1000;
constexpr std::int32_t state_rate_max_hz = 1000;
constexpr std::int32_t proximity_max_cm = 400;  // range of the HC-SR04; a threshold of 0: off

enum class Direction : std::uint8_t { reverse = 0, forward = 1 };

struct Drive {
  std::uint16_t pwm = 0;  // 0-4095
  Direction direction = Direction::reverse;
  // -1 to 1, negative in reverse.
  double duty() const { return (direction == Direction::reverse ? -pwm : pwm) / double{pwm_max}; }
  friend bool operator==(Drive a, Drive b) { return a.pwm == b.pwm && a.direction == b.direction; }
  friend bool operator!=(Drive a, Drive b) { return !(a == b); }
};

struct Bldc {
  std::uint16_t speed = 0;  // 0-4095
  Direction direction = Direction::reverse;
  bool brake = false;
  // -1 to 1, negative in reverse.
  double duty() const {
    return (direction == Direction::reverse ? -speed : speed) / double{pwm_max};
  }
  friend bool operator==(Bldc a, Bldc b) {
    return a.speed == b.speed && a.direction == b.direction && a.brake == b.brake;
  }
  friend bool operator!=(Bldc a, Bldc b) { return !(a == b); }
};

// Why the outputs are safe. The number is the value of the SAFE field.
enum class SafeReason : std::uint8_t {
  none = 0,
  link = 1,       // no valid host heartbeat within the timeout, or the transport is down
  stop = 2,       // E:STOP, until E:CLEAR
  handle = 3,     // the dead-man's handle is released
  proximity = 4,  // an ultrasonic sensor measures less than its threshold
  watchdog = 5,   // a task of the firmware missed its deadline
  fault = 6,      // a chip does not answer, or the firmware found another fault
};
constexpr int safe_reason_count = 7;

// The reason for a number on the wire; fault for an unknown number.
constexpr SafeReason to_safe_reason(std::uint32_t number) {
  return number < static_cast<std::uint32_t>(safe_reason_count) ? static_cast<SafeReason>(number)
                                                                : SafeReason::fault;
}

// "none", "link", "stop", "handle", "proximity", "watchdog", "fault"; "unknown" for other numbers.
R4LINK_API const char* to_text(SafeReason reason);

// The dead-man's handle. The number is the value of the DMHSTA field.
enum class Handle : std::uint8_t {
  released = 0,  // or the wire is broken
  held = 1,
  none = 2,  // the board has no handle
};
R4LINK_API const char* to_text(Handle handle);

// The number is the second value of the field FAULT (chip,trouble).
enum class ChipTrouble : std::uint8_t {
  none = 0,
  no_acknowledge = 1,  // the chip does not answer
  bus_stuck = 2,       // a line of the bus is held low
  was_reset = 3,       // the chip has reset itself and lost its set-up
  wrong_register = 4,  // a register does not hold the written value
  not_ready = 5,       // the chip is not ready in time, or cannot store its power-on values
  // Faults of the wiring (docs/reference/safety.md), with address 0:
  not_confirmed = 6,  // no wiring was given, and the plan was not confirmed
  damaged = 7,        // the stored wiring is damaged or cannot be read
  other_bus = 8,      // the chips answer on the I2C bus that the wiring does not name
};
// "none", "no acknowledge", "bus stuck" …; "unknown" for other numbers.
R4LINK_API const char* to_text(ChipTrouble trouble);

struct ChipFault {
  std::uint8_t address = 0;
  ChipTrouble trouble = ChipTrouble::none;
  bool any() const { return trouble != ChipTrouble::none; }
  friend bool operator==(ChipFault a, ChipFault b) {
    return a.address == b.address && a.trouble == b.trouble;
  }
  friend bool operator!=(ChipFault a, ChipFault b) { return !(a == b); }
};

// The chip at an address (paper, Figure 3): "PCA9685 0x40 (OSMC)". 0: "wiring". Any
// other address: "unknown chip".
R4LINK_API const char* chip_name(std::uint8_t address);

// --- devices on the user's I2C bus (docs/how-to/devices.md)

constexpr int i2c_slots = 8;       // repeated readings
constexpr int i2c_max_bytes = 32;  // in each direction of one transfer
// The other 7-bit addresses are reserved (UM10204, 3.1.12).
constexpr std::uint8_t i2c_first_address = 8;
constexpr std::uint8_t i2c_last_address = 0x77;
constexpr int i2c_max_register_bytes = 2;
constexpr std::uint16_t i2c_min_period_ms = 5;
constexpr std::uint16_t i2c_max_period_ms = 60000;

// The bytes of a device in a state, at most `most`. The bytes after the first `size` are undefined.
template <int most>
struct DeviceBytes {
  DeviceBytes() {}  // NOLINT(modernize-use-equals-default): the bytes need no value, and cost none
  std::uint8_t size = 0;
  std::uint8_t bytes[most];
  const std::uint8_t* begin() const { return bytes; }
  const std::uint8_t* end() const { return bytes + size; }
};

// The newest result of a repeated reading (X:POLL).
struct I2cReading {
  std::uint32_t t_ms = 0;    // the board's clock when the reading began
  std::uint32_t errors = 0;  // failed readings since the setup
  DeviceBytes<i2c_max_bytes> data;
};

// How a transfer ended. The number is the value in the fields I2CX and I2CBUS.
enum class I2cOutcome : std::uint8_t {
  done = 0,
  no_acknowledge = 1,  // no device has the address, or a device refused a byte
  bus_stuck = 2,       // a device holds a line of the bus low
  cancelled = 3,       // the board went safe before the transfer, or another session started
};
// "done", "no acknowledge", "bus stuck", "cancelled"; "unknown" for other numbers.
R4LINK_API const char* to_text(I2cOutcome outcome);

// The newest single transfer (X:READ, X:WRITE, X:SCAN).
struct I2cAnswer {
  std::uint32_t pnum = 0;  // of the transfer's command; 0: none
  I2cOutcome outcome = I2cOutcome::done;
  DeviceBytes<i2c_max_bytes> data;  // the bytes read; for a scan, the addresses that answer
};

struct I2cBusReport {
  I2cOutcome newest = I2cOutcome::done;  // the newest outcome of any transfer
  std::uint32_t errors = 0;              // failed transfers since the board started
  std::uint32_t recoveries = 0;          // how often the board freed the bus with clock pulses
};

// --- the user's UARTs, DAC and spare inputs (docs/how-to/devices.md)

constexpr int uart_channels = 2;
constexpr int uart_max_write = 48;  // in one command
constexpr int uart_max_bytes = 64;  // in one state
constexpr std::uint32_t uart_min_baud = 1200;
constexpr std::uint32_t uart_max_baud = 460800;
constexpr int dac_channels = 2;
constexpr std::int32_t dac_max_mv = 3300;
constexpr int gpio_channels = 8;  // inputs

// If there is room, a state repeats the previous state's new bytes: one lost state loses no byte.
struct UartBytes {
  std::uint32_t position =
      0;  // of the first byte of `data`, in all bytes kept since the board started; wraps
  std::uint32_t lost =
      0;  // bytes damaged or without room since the board started; not counted in `position`
  DeviceBytes<uart_max_bytes> data;
};

// --- sessions, refusals, links and peers

// Identifies a host's session (SID): 64 random bits, new for each session.
using SessionId = std::uint64_t;
// The id in datagrams of watchers and paper hosts, and in datagrams for everyone.
constexpr SessionId no_session = 0;

// The code in `N:<PNum>,<code>`: why a board refuses a command (docs/reference/protocol.md).
enum class Refusal : std::uint8_t {
  none,
  unknown,  // no such command, field or setting
  format,   // wrong form
  range,
  channel,    // no such channel
  stale,      // older than an executed command, or delayed too long
  duplicate,  // the board has executed this packet number
  safe,       // the outputs are in the safe state
  busy,       // another host controls the board
  auth,       // not authenticated
  full,       // no room: send the command again later
};

// "UNKNOWN", "FORMAT" …; "NONE" for none.
R4LINK_API Text name_of(Refusal refusal);
// The refusal with this name; Refusal::none for an unknown name.
R4LINK_API Refusal refusal_from(Text name);

// A board's refusal of a command. `session`: SESSION, the number of the heartbeat that started the
// session. Only the session's host gets SESSION, which shows whether the board remembers executed
// commands.
struct Nack {
  std::uint32_t pnum = 0;
  Refusal code = Refusal::none;
  std::uint8_t at = 0;  // AT: the command of a group, from 1; 0: not a group, or the whole group
  bool has_session = false;
  std::uint32_t session = 0;
  std::uint32_t lease = 0;  // LEASE: the next W must echo it; 0: none
  SessionId sid = no_session;
};

enum class HostLinkState : std::uint8_t {
  connecting,  // no valid datagram has arrived, or the board is booting
  active,      // the board reports its state, and no safe reason
  safe,        // the board reports a safe reason
  lost,        // no valid datagram of the board arrived for the timeout
};

constexpr bool is_heard(HostLinkState state) {
  return state == HostLinkState::active || state == HostLinkState::safe;
}
R4LINK_API const char* to_text(HostLinkState state);

struct LinkTiming {
  std::uint32_t heartbeat_ms = 100;  // 10 Hz: a few lost datagrams must not reach the timeout
  std::uint32_t timeout_ms = 1000;   // silence of the board until HostLinkState::lost
};

struct PacketCounters {
  std::uint32_t received = 0;  // all packets, including the kinds below
  std::uint32_t lost = 0;      // missing in gaps, without late packets
  std::uint32_t duplicate = 0;
  std::uint32_t late = 0;
  std::uint32_t old = 0;
  std::uint32_t restarts = 0;
};

// A peer, such as one of the hosts at a board's UDP socket. A transport numbers the senders of
// valid datagrams. `everyone`: the transport's default receivers, and senders of invalid datagrams.
using Peer = std::uint32_t;
constexpr Peer everyone = 0;

enum class Priority : std::uint8_t {
  state,  // a newer state replaces a waiting state
  // W, which waits as `normal` and has its own frame on a bus (docs/reference/can.md)
  lease,
  normal,  // refused if the queue is full
  stop,    // overtakes all other datagrams and is never dropped
};

}  // namespace r4
