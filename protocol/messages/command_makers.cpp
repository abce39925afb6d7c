// SPDX-License-Identifier: GPL-3.0-or-later
// The commands that a program makes: Command::osmc() and its like.
#include "r4link/command.hpp"

namespace r4 {
namespace {

Command of_kind(CommandKind kind) {
  Command command;
  command.kind = kind;
  return command;
}

// 0, which is no channel of any kind and no period, for what does not fit.
template <class Number>
Number number_of(int value) {
  return value > 0 && value <= static_cast<Number>(-1) ? static_cast<Number>(value) : Number{0};
}

Command of_channel(CommandKind kind, std::int32_t value, int channel) {
  Command command = of_kind(kind);
  command.value = value;
  command.channel = number_of<std::uint8_t>(channel);
  return command;
}

// More than there may be of anything that is counted.
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
Command Command::osmc(std::int32_t pwm, Direction direction, int channel) {
  Command command = of_channel(CommandKind::osmc, pwm, channel);
  command.direction = direction;
  return command;
}
Command Command::dhb12(std::int32_t pwm, Direction direction, int channel) {
  Command command = of_channel(CommandKind::dhb12, pwm, channel);
  command.direction = direction;
  return command;
}
Command Command::servo(std::int32_t us, int channel) {
  return of_channel(CommandKind::servo, us, channel);
}
Command Command::relay(int channel, bool on) {
  Command command = of_channel(CommandKind::relay, 0, channel);
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
Command Command::stepper(std::int32_t target_steps, std::int32_t steps_per_s, int channel) {
  Command command = of_channel(CommandKind::stepper, target_steps, channel);
  command.speed = steps_per_s;
  return command;
}
Command Command::zero(int channel) { return of_channel(CommandKind::zero, 0, channel); }
Command Command::bldc(std::int32_t speed, Direction direction, bool brake, int channel) {
  Command command = of_channel(CommandKind::bldc, speed, channel);
  command.direction = direction;
  command.on = brake;
  return command;
}
Command Command::proximity(std::int32_t cm, int channel) {
  return of_channel(CommandKind::proximity, cm, channel);
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
  // 0 bytes would be its end.
  if (command.count == 0) command.count = out_of_range;
  command.period_ms = number_of<std::uint16_t>(period_ms);
  return command;
}
Command Command::i2c_poll_off(int slot) {
  Command command = of_kind(CommandKind::i2c_poll);
  command.channel = number_of<std::uint8_t>(slot);
  return command;
}
Command Command::uart_write(int channel, Text bytes) {
  Command command = of_channel(CommandKind::uart_write, 0, channel);
  command.text = bytes;
  return command;
}
Command Command::dac(int channel, std::int32_t millivolts) {
  return of_channel(CommandKind::dac, millivolts, channel);
}
Command Command::identify() { return of_kind(CommandKind::identify); }

}  // namespace r4
