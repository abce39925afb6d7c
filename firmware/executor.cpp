// SPDX-License-Identifier: GPL-3.0-or-later
#include "executor.hpp"

#include "../protocol/messages/command_field.hpp"

namespace r4 {
namespace firmware {

namespace {

constexpr int supply_relay = 1;  // of the motors (docs/safety.md)

void set_relay(std::uint8_t& relays, int channel, bool on) {
  const unsigned bit = 1U << static_cast<unsigned>(channel - 1);
  relays = static_cast<std::uint8_t>(on ? relays | bit : relays & ~bit);
}

// Called when the relay of the motors' supply is about to close: a motor whose command came while
// there was no supply, or was held back by a network, must not start because of the relay. A voltage
// may be the throttle of one.
void stop_motors(Outputs& outputs) {
  for (Drive& channel : outputs.osmc) channel.pwm = 0;
  for (Drive& channel : outputs.dhb12) channel.pwm = 0;
  for (Bldc& channel : outputs.bldc) channel.speed = 0;
  for (StepperTarget& channel : outputs.stepper) channel = StepperTarget();
  for (std::uint16_t& millivolts : outputs.dac_mv) millivolts = 0;
}

}  // namespace

Refusal carry_out(const Command& command, Setpoints& setpoints) {
  const int i = command.channel - 1;
  const int channels = row_of(command.kind).channels;
  if (channels != 0 && (i < 0 || i >= channels)) return Refusal::channel;  // it is an index below
  const std::uint16_t value = static_cast<std::uint16_t>(command.value);
  Outputs& outputs = setpoints.outputs;
  switch (command.kind) {
    case CommandKind::osmc:
      outputs.osmc[i].pwm = value;
      outputs.osmc[i].direction = command.direction;
      break;
    case CommandKind::dhb12:
      outputs.dhb12[i].pwm = value;
      outputs.dhb12[i].direction = command.direction;
      break;
    case CommandKind::servo:
      outputs.servo_us[i] = value;
      break;
    case CommandKind::relay:
      if (command.channel == supply_relay && command.on && (outputs.relays & 1) == 0) {
        stop_motors(outputs);
      }
      set_relay(outputs.relays, command.channel, command.on);
      break;
    case CommandKind::stepper:
      outputs.stepper[i].position = command.value;
      outputs.stepper[i].speed = command.speed;
      outputs.stepper[i].enabled = true;
      break;
    case CommandKind::zero:
      if (i < stepper_channels) outputs.stepper[i] = StepperTarget();
      break;
    case CommandKind::bldc:
      outputs.bldc[i].speed = value;
      outputs.bldc[i].direction = command.direction;
      outputs.bldc[i].brake = command.on;
      break;
    case CommandKind::dac:
      outputs.dac_mv[i] = value;
      break;
    case CommandKind::proximity:
      setpoints.proximity_cm[i] = value;
      break;
    case CommandKind::fields:
      return parse_fields(command.text, setpoints.fields);
    case CommandKind::setting:
      return set(setpoints.settings, command.text, command.text2);
    case CommandKind::heartbeat:
    case CommandKind::stop:
    case CommandKind::clear:
    case CommandKind::leave:
    case CommandKind::identify:
    case CommandKind::watch:
    case CommandKind::i2c_read:
    case CommandKind::i2c_write:
    case CommandKind::i2c_scan:
    case CommandKind::i2c_poll:
    case CommandKind::i2c_poll_off:
    case CommandKind::uart_write:
      break;
  }
  return Refusal::none;
}

}  // namespace firmware
}  // namespace r4
