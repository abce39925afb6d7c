// SPDX-License-Identifier: GPL-3.0-or-later
// Every command of the board, typed and checked (paper section 4.2; docs/reference/protocol.md).
#pragma once

#include <cstdint>
#include <type_traits>

#include "config.hpp"
#include "tables/commands.hpp"
#include "vocabulary.hpp"

namespace r4 {

// --- outputs: a type for each channel and value, so that swapped arguments do not compile

// The number of a channel on the board, from 1. The board refuses a channel that it lacks.
struct Channel {
  template <class Integer, class = std::enable_if_t<std::is_integral<Integer>::value &&
                                                    !std::is_same<Integer, bool>::value>>
  constexpr Channel(Integer channel)  // NOLINT(google-explicit-constructor)
      : number(in_range(static_cast<std::int64_t>(channel))) {}
  std::uint8_t number;  // 0, which is never a channel, for numbers outside 1-255

 private:
  static constexpr std::uint8_t in_range(std::int64_t channel) {
    return channel > 0 && channel <= 0xFF ? static_cast<std::uint8_t>(channel) : std::uint8_t{0};
  }
};

// A number with a unit. A value outside its range is refused.
template <class Unit>
struct Quantity {
  constexpr explicit Quantity(std::int32_t number) : value(number) {}
  std::int32_t value;
};
using Pwm = Quantity<struct PwmUnit>;                    // 0-4095 (pwm_max), the full drive
using Microseconds = Quantity<struct MicrosecondsUnit>;  // a servo's pulse, 0 (off) to 2500
using Steps = Quantity<struct StepsUnit>;                // a stepper's position, any 32-bit value
using StepsPerSecond = Quantity<struct StepsPerSecondUnit>;  // 1-20000
using Millivolts = Quantity<struct MillivoltsUnit>;          // 0-3300
using Centimetres = Quantity<struct CentimetresUnit>;        // 0 (off) to 400

// The drive of a motor: from -1 (full reverse) to 1 (full forward).
struct Duty {
  template <class Number, class = std::enable_if_t<std::is_arithmetic<Number>::value &&
                                                   !std::is_same<Number, bool>::value>>
  constexpr explicit Duty(Number duty) : value(static_cast<double>(duty)) {}
  constexpr bool is_in_range() const { return value >= -1 && value <= 1; }
  // Rounded to the nearest Pwm. If the duty is out of range, the result is out of the range of Pwm.
  constexpr Pwm pwm() const {
    const double twice = 2 * pwm_max * (value < 0 ? -value : value);
    return Pwm(is_in_range() ? (static_cast<std::int32_t>(twice) + 1) / 2 : pwm_max + 1);
  }
  constexpr Direction direction() const {
    return value < 0 ? Direction::reverse : Direction::forward;
  }
  double value;
};

// `kind` determines the members in use; the factories set them. Texts are views.
struct R4LINK_API Command {
  Command() {}  // NOLINT(modernize-use-equals-default): else GCC calls memset for it
  CommandKind kind = CommandKind::heartbeat;
  std::uint8_t channel = 0;     // from 1 to the kind's channel count; i2c_poll: the slot
  std::uint16_t period_ms = 0;  // i2c_poll: 5-60000
  // pwm, us, cm, BLDC speed, stepper target, Hz, mV; clear: the cause; i2c: the device's address
  std::int32_t value = 0;
  std::int32_t speed = stepper_speed_default;  // stepper, steps per second
  Direction direction = Direction::reverse;    // osmc, dhb12, bldc
  bool on = false;                             // relay; bldc: brake
  std::uint8_t count = 0;                      // i2c: number of bytes to read
  // fields, watch: the list; setting: the key; i2c, uart: the register or the bytes, as "x3B"
  Text text;
  Text text2;  // setting: the value

  static Command heartbeat();
  static Command osmc(Channel channel, Pwm pwm, Direction direction);
  static Command osmc(Channel channel, Duty duty) {
    return osmc(channel, duty.pwm(), duty.direction());
  }
  static Command dhb12(Channel channel, Pwm pwm, Direction direction);
  static Command dhb12(Channel channel, Duty duty) {
    return dhb12(channel, duty.pwm(), duty.direction());
  }
  static Command servo(Channel channel, Microseconds pulse);
  static Command relay(Channel channel, bool on);
  static Command stop();
  // `cause`: the number of the cause to clear, from CAUSE in the board's heartbeats; 0 if the
  // heartbeats have no CAUSE. unnamed_cause: Session fills in the number or omits it.
  static constexpr std::int32_t unnamed_cause = -1;
  static Command clear(std::int32_t cause = unnamed_cause);
  // Ends control: the board is safe at once, and any host may control it.
  static Command leave();
  static Command stepper(Channel channel, Steps position,
                         StepsPerSecond speed = StepsPerSecond(stepper_speed_default));
  // Sets the stepper's position and the encoder's count to 0.
  static Command zero(Channel channel);
  static Command bldc(Channel channel, Pwm speed, Direction direction, bool brake = false);
  static Command bldc(Channel channel, Duty duty, bool brake = false) {
    return bldc(channel, duty.pwm(), duty.direction(), brake);
  }
  // If the ultrasonic sensor measures less than `threshold`, the board goes safe. 1-400 cm; 0: off.
  static Command proximity(Channel channel, Centimetres threshold);
  static Command fields(Text list);
  static Command setting(Text key, Text value);
  static Command identify();
  // Requests the board's wiring; only over the board's own cable.
  static Command ask_wiring();
  // The board streams its states to the sender for two seconds, without control; 0 Hz ends the
  // stream. `list`: the fields; empty: the fields that the controlling host has chosen.
  static Command watch(std::int32_t rate_hz, Text list = Text());
  // Transfers on the user's I2C bus (docs/how-to/devices.md). Addresses have 7 bits. Bytes are x
  // and two hexadecimal digits each, "x75"; "x": no bytes. The answer is I2CX in the state.
  static Command i2c_read(int address, Text register_bytes, int count);
  static Command i2c_write(int address, Text bytes, int count = 0);  // then reads `count` bytes
  static Command i2c_scan();
  // The board reads the device every `period_ms` (5-60000); I2C1 … I2C8 of states have the bytes.
  static Command i2c_poll(int slot, int address, Text register_bytes, int count, int period_ms);
  static Command i2c_poll_off(int slot);
  // Sends on one of the user's UARTs: at most uart_max_write bytes.
  static Command uart_write(Channel channel, Text bytes);
  // Sets one of the user's output voltages, 0-3300 mV; 0 in the safe state.
  static Command dac(Channel channel, Millivolts voltage);
};

// The most commands in one datagram. A group is several output commands for different channels,
// which are executed together or not at all (docs/reference/protocol.md; setpoints.hpp).
constexpr int max_group = 16;

// Checks the ranges of a command from a factory. If a value is wrong, returns Refusal::format,
// ::channel or ::range. Settings and names of fields are not checked.
R4LINK_API Refusal check_command(const Command& command);

}  // namespace r4
