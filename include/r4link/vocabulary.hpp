// SPDX-License-Identifier: GPL-3.0-or-later
// The channels of a board, and small types of commands, states and the link: counts and ranges
// (paper section 2; table in docs/reference/protocol.md), reasons, troubles and refusals.
#pragma once

#include <cstdint>

#include "config.hpp"
#include "text.hpp"

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
constexpr std::int32_t state_rate_max_hz = 1000;
constexpr std::int32_t proximity_max_cm = 400;  // HC-SR04 range; a threshold of 0 is off

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
  proximity = 4,  // an ultrasonic sensor sees something nearer than its threshold
  watchdog = 5,   // a task of the firmware missed its deadline
  fault = 6,      // a chip does not answer, or the firmware found a fault of its own
};
constexpr int safe_reason_count = 7;

// The reason of a number on the wire; fault for an unknown number.
constexpr SafeReason to_safe_reason(std::uint32_t number) {
  return number < static_cast<std::uint32_t>(safe_reason_count) ? static_cast<SafeReason>(number)
                                                                : SafeReason::fault;
}

// "none", "link", "stop", "handle", "proximity", "watchdog", "fault"; "unknown" for other numbers.
R4LINK_API const char* to_text(SafeReason reason);

// The dead-man's handle. The number is the value of the DMHSTA field.
enum class Handle : std::uint8_t {
  released = 0,  // or its wire is broken
  held = 1,
  none = 2,  // the board has no handle
};
// "released", "held", "none".
R4LINK_API const char* to_text(Handle handle);

// --- faults of a chip of the board, or of its wiring

// The number is the value of the FAULT field.
enum class ChipTrouble : std::uint8_t {
  none = 0,
  no_acknowledge = 1,  // the chip does not answer
  bus_stuck = 2,       // a line of the bus is held low
  was_reset = 3,       // the chip lost its set-up, so it was reset
  wrong_register = 4,  // a register does not hold the written value
  not_ready = 5,       // not ready in time, or cannot store its power-on values
  // Of the wiring (docs/reference/safety.md), with address 0:
  not_confirmed = 6,  // nobody has given a wiring, or confirmed the plan
  damaged = 7,        // the stored wiring is damaged, or the store cannot be read
  other_bus = 8,      // the chips answer on the other I2C bus than the wiring says
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

// The chip at an address (paper, Figure 3): "PCA9685 0x40 (OSMC)"; 0: "wiring"; or "unknown chip".
R4LINK_API const char* chip_name(std::uint8_t address);

// --- devices on the user's I2C bus (docs/how-to/devices.md)

constexpr int i2c_slots = 8;       // readings that the board repeats by itself
constexpr int i2c_max_bytes = 32;  // each way, of one transfer
// Other addresses are reserved (UM10204, 3.1.12).
constexpr std::uint8_t i2c_first_address = 8;
constexpr std::uint8_t i2c_last_address = 0x77;
constexpr int i2c_max_register_bytes = 2;
constexpr std::uint16_t i2c_min_period_ms = 5;
constexpr std::uint16_t i2c_max_period_ms = 60000;

// The bytes of a device in a state, at most `most`. Bytes from `size` on are undefined.
template <int most>
struct DeviceBytes {
  DeviceBytes() {}  // NOLINT(modernize-use-equals-default): the bytes need no value, and cost none
  std::uint8_t size = 0;
  std::uint8_t bytes[most];
  const std::uint8_t* begin() const { return bytes; }
  const std::uint8_t* end() const { return bytes + size; }
};

// The newest of one of the board's repeated readings (X:POLL).
struct I2cReading {
  std::uint32_t t_ms = 0;    // the board's clock when the bytes were read
  std::uint32_t errors = 0;  // failed readings since its setup
  DeviceBytes<i2c_max_bytes> data;
};

// How a transfer ended. The number is the value in the fields I2CX and I2CBUS.
enum class I2cOutcome : std::uint8_t {
  done = 0,
  no_acknowledge = 1,  // no device has the address, or the device refused a byte
  bus_stuck = 2,       // a device holds a line of the bus
  cancelled = 3,       // the board went safe before it started, or another session started
};
// "done", "no acknowledge", "bus stuck", "cancelled"; "unknown" for other numbers.
R4LINK_API const char* to_text(I2cOutcome outcome);

// The newest single transfer (X:READ, X:WRITE, X:SCAN).
struct I2cAnswer {
  std::uint32_t pnum = 0;  // of its command; 0: none yet
  I2cOutcome outcome = I2cOutcome::done;
  DeviceBytes<i2c_max_bytes> data;  // the bytes read; for a scan, the addresses that answer
};

struct I2cBusReport {
  I2cOutcome newest = I2cOutcome::done;  // of all transfers
  std::uint32_t errors = 0;              // failed transfers since the board started
  std::uint32_t recoveries = 0;          // how often the bus was clocked free
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

// If there is room, a state repeats the new bytes of the previous one: its loss loses no bytes.
struct UartBytes {
  std::uint32_t position =
      0;  // of data's first byte, in all bytes kept since the board started; wraps
  std::uint32_t lost =
      0;  // damaged, or without room, since the board started; not counted in `position`
  DeviceBytes<uart_max_bytes> data;
};

// Identifies a host's session (SID): 64 random bits that only the host and its board know. Chosen
// anew for each session, so it is worthless afterwards.
using SessionId = std::uint64_t;
// For watchers, hosts of the paper, and datagrams for everyone.
constexpr SessionId no_session = 0;

// Why a board refuses a command: the code in `N:<PNum>,<code>` (docs/reference/protocol.md).
enum class Refusal : std::uint8_t {
  none,
  unknown,  // no such command, field or setting
  format,   // not of the command's form
  range,
  channel,    // no such channel
  stale,      // older than an executed command, or delayed too long
  duplicate,  // this packet number was executed already
  safe,       // outputs are in the safe state
  busy,       // another host controls the board
  auth,       // not authenticated
  full,       // no free place for it: ask again later
};

// "UNKNOWN", "FORMAT" …; "NONE" for none.
R4LINK_API Text name_of(Refusal refusal);
// The refusal of that name; Refusal::none if unknown.
R4LINK_API Refusal refusal_from(Text name);

// A refusal as the board answers it. SESSION, for the session's host: the heartbeat that started
// it, so that the host knows whether the board remembers executed commands.
struct Nack {
  std::uint32_t pnum = 0;
  Refusal code = Refusal::none;
  std::uint8_t at = 0;  // AT, which command of a group, from 1; 0: not a group, or the whole group
  bool has_session = false;
  std::uint32_t session = 0;
  std::uint32_t lease = 0;  // LEASE, which the next W has to echo; 0: none
  SessionId sid = no_session;
};

enum class HostLinkState : std::uint8_t {
  connecting,  // nothing heard yet, or the board is booting
  active,      // the board streams its state and reports no reason to be safe
  safe,        // the board reports a reason
  lost,        // no valid datagram came from the board for the timeout
};

// True if the board is heard and reports its state.
constexpr bool is_heard(HostLinkState state) {
  return state == HostLinkState::active || state == HostLinkState::safe;
}
// "connecting", "active", "safe", "lost".
R4LINK_API const char* to_text(HostLinkState state);

struct LinkTiming {
  std::uint32_t heartbeat_ms = 100;  // 10 Hz: one lost packet must not race the timeout
  std::uint32_t timeout_ms = 1000;   // silence of the board until `lost`
};

struct PacketCounters {
  std::uint32_t received = 0;  // all packets, of every kind below
  std::uint32_t lost = 0;      // in gaps, and not arrived late
  std::uint32_t duplicate = 0;
  std::uint32_t late = 0;
  std::uint32_t old = 0;
  std::uint32_t restarts = 0;
};

// --- delivery of a datagram: to which peer, and what happens if there is no room

// A peer, if there can be several (hosts at a board's UDP socket). A transport numbers the senders
// of valid datagrams. `everyone`: all standing receivers, and invalid senders.
using Peer = std::uint32_t;
constexpr Peer everyone = 0;

enum class Priority : std::uint8_t {
  state,  // newest wins: an older waiting state is replaced
  // W, renewed each second; waits as `normal`; has its own frame on a bus (docs/reference/can.md)
  lease,
  normal,  // waits its turn; refused if the queue is full
  stop,    // overtakes all others and is never dropped
};

}  // namespace r4
