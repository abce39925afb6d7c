// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/command.hpp"

namespace r4 {
namespace {

Command of_kind(CommandKind kind) {
  Command command;
  command.kind = kind;
  return command;
}

// 0 for a value that does not fit, because 0 is not a valid channel or period.
template <class Number>
Number number_of(int value) {
  return value > 0 && value <= static_cast<Number>(-1) ? static_cast<Number>(value) : Number{0};
}

Command of_channel(CommandKind kind, Channel channel, std::int32_t value) {
  Command command = of_kind(kind);
  command.value = value;
  command.channel = channel.number;
  return command;
}

Command of_motor(CommandKind kind, Channel channel, Pwm pwm, Direction direction) {
  Command command = of_channel(kind, channel, pwm.value);
  command.direction = direction;
  return command;
}

constexpr std::uint8_t out_of_range = 0xFF;

Command of_device(CommandKind kind, int address, Text bytes, int count) {
  Command command = of_kind(kind);
  command.value = address;
  command.text = bytes;
  command.count =
      count >= 0 && count < out_of_range ? static_cast<std::uint8_t>(count) : out_of_range;
  return command;
}

}  // namespace

Command Command::heartbeat() { return of_kind(CommandKind::heartbeat); }
Command Command::osmc(Channel channel, Pwm pwm, Direction direction) {
  return of_motor(CommandKind::osmc, channel, pwm, direction);
}
Command Command::dhb12(Channel channel, Pwm pwm, Direction direction) {
  return of_motor(CommandKind::dhb12, channel, pwm, direction);
}
Command Command::servo(Channel channel, Microseconds pulse) {
  return of_channel(CommandKind::servo, channel, pulse.value);
}
Command Command::relay(Channel channel, bool on) {
  Command command = of_channel(CommandKind::relay, channel, 0);
  command.on = on;
  return command;
}
Command Command::stop() { return of_kind(CommandKind::stop); }
Command Command::clear(std::int32_t cause) {
  Command command = of_kind(CommandKind::clear);
  command.value = cause;
  return command;
}
Command Command::leave() { return of_kind(CommandKind::leave); }
Command Command::stepper(Channel channel, Steps position, StepsPerSecond speed) {
  Command command = of_channel(CommandKind::stepper, channel, position.value);
  command.speed = speed.value;
  return command;
}
Command Command::zero(Channel channel) { return of_channel(CommandKind::zero, channel, 0); }
Command Command::bldc(Channel channel, Pwm speed, Direction direction, bool brake) {
  Command command = of_motor(CommandKind::bldc, channel, speed, direction);
  command.on = brake;
  return command;
}
Command Command::proximity(Channel channel, Centimetres threshold) {
  return of_channel(CommandKind::proximity, channel, threshold.value);
}
Command Command::fields(Text list) {
  Command command = of_kind(CommandKind::fields);
  command.text = list;
  return command;
}
Command Command::setting(Text key, Text value) {
  Command command = of_kind(CommandKind::setting);
  command.text = key;
  command.text2 = value;
  return command;
}
Command Command::watch(std::int32_t rate_hz, Text list) {
  Command command = of_kind(CommandKind::watch);
  command.value = rate_hz;
  command.text = list;
  return command;
}
Command Command::i2c_read(int address, Text register_bytes, int count) {
  return of_device(CommandKind::i2c_read, address, register_bytes, count);
}
Command Command::i2c_write(int address, Text bytes, int count) {
  return of_device(CommandKind::i2c_write, address, bytes, count);
}
Command Command::i2c_scan() { return of_kind(CommandKind::i2c_scan); }
Command Command::i2c_poll(int slot, int address, Text register_bytes, int count, int period_ms) {
  Command command = of_device(CommandKind::i2c_poll, address, register_bytes, count);
  command.channel = number_of<std::uint8_t>(slot);
  command.period_ms = number_of<std::uint16_t>(period_ms);
  return command;
}
Command Command::i2c_poll_off(int slot) {
  Command command = of_kind(CommandKind::i2c_poll_off);
  command.channel = number_of<std::uint8_t>(slot);
  return command;
}
Command Command::uart_write(Channel channel, Text bytes) {
  Command command = of_channel(CommandKind::uart_write, channel, 0);
  command.text = bytes;
  return command;
}
Command Command::dac(Channel channel, Millivolts voltage) {
  return of_channel(CommandKind::dac, channel, voltage.value);
}
Command Command::identify() { return of_kind(CommandKind::identify); }
Command Command::ask_wiring() { return of_kind(CommandKind::ask_wiring); }

}  // namespace r4
