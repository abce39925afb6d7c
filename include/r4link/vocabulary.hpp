// SPDX-License-Identifier: GPL-3.0-or-later
// What the board has, and the small values that commands, states and the link share: channel counts and
// ranges (paper section 2; docs/protocol.md has the table), reasons, troubles and refusals.
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

// One H-bridge channel (OSMC or DHB12).
struct Drive {
  std::uint16_t pwm = 0;  // 0-4095
  Direction direction = Direction::reverse;
  // -1 to 1, negative in reverse.
  double duty() const { return (direction == Direction::reverse ? -pwm : pwm) / double{pwm_max}; }
  friend bool operator==(Drive a, Drive b) { return a.pwm == b.pwm && a.direction == b.direction; }
  friend bool operator!=(Drive a, Drive b) { return !(a == b); }
};

// One brushless driver channel.
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
R4LINK_API const char* to_text(SafeReason reason);

// --- a chip of the board that is in trouble

// The number is what the FAULT field carries.
enum class ChipTrouble : std::uint8_t {
  none = 0,
  no_acknowledge = 1,  // it does not answer
  bus_stuck = 2,       // a line of the bus is held
  was_reset = 3,       // it lost its set-up: it must have been reset under way
  wrong_register = 4,  // a register holds what was not written
  not_ready = 5,       // it did not come up in time, or cannot store its power-on values
};
// "none", "no acknowledge", "bus stuck", "was reset", "wrong register", "not ready"; "unknown" for
// other numbers.
R4LINK_API const char* to_text(ChipTrouble trouble);

// The chip by its I2C address.
struct ChipFault {
  std::uint8_t address = 0;
  ChipTrouble trouble = ChipTrouble::none;
  bool any() const { return trouble != ChipTrouble::none; }
  friend bool operator==(ChipFault a, ChipFault b) {
    return a.address == b.address && a.trouble == b.trouble;
  }
  friend bool operator!=(ChipFault a, ChipFault b) { return !(a == b); }
};

// The chip at an address of the board (paper, Figure 3): "PCA9685 0x40 (OSMC)". "unknown chip" for
// other addresses.
R4LINK_API const char* chip_name(std::uint8_t address);

// --- devices on the I2C bus of the user's (docs/devices.md)

constexpr int i2c_slots = 8;       // readings that the board repeats by itself
constexpr int i2c_max_bytes = 32;  // each way, of one transfer
// Those below and above are reserved (UM10204, 3.1.12).
constexpr std::uint8_t i2c_first_address = 8;
constexpr std::uint8_t i2c_last_address = 0x77;
constexpr int i2c_max_register_bytes = 2;
constexpr std::uint16_t i2c_min_period_ms = 5;
constexpr std::uint16_t i2c_max_period_ms = 60000;

// Bytes as a state carries them: at most `most`. Those behind `size` have no value.
template <int most>
struct DeviceBytes {
  DeviceBytes() {}  // NOLINT(modernize-use-equals-default): the bytes need no value, and cost none
  std::uint8_t size = 0;
  std::uint8_t bytes[most];
  const std::uint8_t* begin() const { return bytes; }
  const std::uint8_t* end() const { return bytes + size; }
};

// What one of the board's repeated readings (X:POLL) has found.
struct I2cReading {
  std::uint32_t t_ms = 0;    // the board's clock when the bytes were read
  std::uint32_t errors = 0;  // readings that failed since it was set up
  DeviceBytes<i2c_max_bytes> data;
};

// What became of a transfer. The number is what the fields I2CX and I2CBUS carry.
enum class I2cOutcome : std::uint8_t {
  done = 0,
  no_acknowledge = 1,  // nobody answers to the address, or the device refused a byte
  bus_stuck = 2,       // a device holds a line of the bus
  cancelled = 3,       // the board went safe before it was begun, or another session began
};
// "done", "no acknowledge", "bus stuck", "cancelled"; "unknown" for other numbers.
R4LINK_API const char* to_text(I2cOutcome outcome);

// How the newest single transfer (X:READ, X:WRITE, X:SCAN) ended.
struct I2cAnswer {
  std::uint32_t pnum = 0;  // of its command; 0: there was none yet
  I2cOutcome outcome = I2cOutcome::done;
  DeviceBytes<i2c_max_bytes> data;  // what was read; of a scan, the addresses that answer
};

// How the bus does.
struct I2cBusReport {
  I2cOutcome newest = I2cOutcome::done;  // of all transfers
  std::uint32_t errors = 0;              // transfers that failed since the board began
  std::uint32_t recoveries = 0;          // how often it was clocked free
};

// --- the user's UARTs, DAC and spare inputs (docs/devices.md)

constexpr int uart_channels = 2;
constexpr int uart_max_write = 48;  // bytes of one command
constexpr int uart_max_bytes = 64;  // of one state
constexpr std::uint32_t uart_min_baud = 1200;
constexpr std::uint32_t uart_max_baud = 460800;
constexpr int dac_channels = 2;
constexpr std::int32_t dac_max_mv = 3300;
constexpr int gpio_channels = 8;  // inputs

// What a state carries of what came in on a UART. A state also repeats what was new in the one before it, where
// there is room: one that is lost alone loses nothing then.
struct UartBytes {
  std::uint32_t position =
      0;  // of the first of `data`, in all that was kept since the board began; wraps
  std::uint32_t lost =
      0;  // came damaged, or found no room, since the board began: not in the count above
  DeviceBytes<uart_max_bytes> data;
};

// --- sessions

// Names one session of a host (SID): 64 random bits, which only the host and its board know. It is chosen anew for
// each session, so it is worthless once the session is over.
using SessionId = std::uint64_t;
// That of watchers, of the paper's hosts, and in what is for everyone.
constexpr SessionId no_session = 0;

// --- refusals

// Why a board refuses a command: the code of `N:<PNum>,<code>` (docs/protocol.md).
enum class Refusal : std::uint8_t {
  none,
  unknown,    // no such command, field or setting
  format,     // not the command's form
  range,      // a value outside its range
  channel,    // no such channel
  stale,      // older than what was executed, or delayed too long
  duplicate,  // this very packet number was executed
  safe,       // outputs are in the safe state
  busy,       // another host controls the board
  auth,       // not authenticated
  full,       // what it needs is in use: ask again when that has ended
};

// "UNKNOWN", "FORMAT" …; "NONE" for none.
R4LINK_API Text name_of(Refusal refusal);
// The refusal of that name; Refusal::none if there is none.
R4LINK_API Refusal refusal_from(Text name);

// A refusal as the board answers it: the session id and number of the command, and why; of a group, which of its
// commands (AT); and to the host of the session, the number of the heartbeat that began it (SESSION), so that
// the host knows whether the board still remembers what it executed.
struct Nack {
  std::uint32_t pnum = 0;
  Refusal code = Refusal::none;
  std::uint8_t at = 0;  // from 1; 0: it is none of a group, or the group was refused as a whole
  bool has_session = false;
  std::uint32_t session = 0;
  std::uint32_t lease = 0;  // what a W has to echo (LEASE); 0: none is told
  SessionId sid = no_session;
};

// --- the link, seen from the host

enum class HostLinkState : std::uint8_t {
  connecting,  // nothing was heard yet, or the board is booting
  active,      // the board streams its state and reports no reason to be safe
  safe,        // the board reports a reason
  lost,        // nothing valid came from the board for the timeout
};

// Is the board there, and knows what it does?
constexpr bool is_heard(HostLinkState state) {
  return state == HostLinkState::active || state == HostLinkState::safe;
}
// "connecting", "active", "safe", "lost".
R4LINK_API const char* to_text(HostLinkState state);

// What the host keeps to.
struct LinkTiming {
  std::uint32_t heartbeat_ms = 100;  // 10 Hz: one lost packet must not be a race with the timeout
  std::uint32_t timeout_ms = 1000;   // silence of the board until `lost`
};

struct PacketCounters {
  std::uint32_t received = 0;  // every call of on()
  std::uint32_t lost = 0;      // in gaps and not arrived late
  std::uint32_t duplicate = 0;
  std::uint32_t late = 0;
  std::uint32_t old = 0;
  std::uint32_t restarts = 0;
};

// --- how a datagram is to be delivered: to whom, and what becomes of it where there is no room

// Who is at the other end, where several can be (hosts at a board's UDP socket). A transport hands a
// number out for each sender of a valid datagram; `everyone` is its standing audience, and whoever
// sent what is none.
using Peer = std::uint32_t;
constexpr Peer everyone = 0;

// What a datagram is to the transport that sends it.
enum class Priority : std::uint8_t {
  state,  // newest wins: an older waiting state is replaced
  lease,  // W, by which a watcher asks for states. It is renewed each second, and waits as `normal`
          // does. A bus carries it as a frame of its own (docs/can.md, "Who watches")
  normal,  // waits its turn; refused when the queue is full
  stop,    // overtakes everything and is never dropped
};

}  // namespace r4
