// SPDX-License-Identifier: GPL-3.0-or-later
#include "executor.hpp"

#include "../protocol/messages/command_field.hpp"

namespace r4 {
namespace firmware {

namespace {

constexpr int supply_relay = 1;  // for the motors' supply (docs/reference/safety.md)

void set_relay(std::uint8_t& relays, int channel, bool on) {
  const unsigned bit = 1U << static_cast<unsigned>(channel - 1);
  relays = static_cast<std::uint8_t>(on ? relays | bit : relays & ~bit);
}

void set_value(std::uint16_t& output, std::uint16_t value) { output = value; }
void set_value(Drive& output, std::uint16_t value) { output.pwm = value; }
void set_value(Bldc& output, std::uint16_t value) { output.speed = value; }

void set(std::uint16_t& output, const Command& command) {
  output = static_cast<std::uint16_t>(command.value);
}
void set(Drive& output, const Command& command) {
  output.pwm = static_cast<std::uint16_t>(command.value);
  output.direction = command.direction;
}
void set(Bldc& output, const Command& command) {
  output.speed = static_cast<std::uint16_t>(command.value);
  output.direction = command.direction;
  output.brake = command.on;
}

// Called before the relay of the motors' supply closes. A command that arrived without supply, or
// that a network delayed, must not start a motor. A voltage may be a motor's throttle.
void stop_motors(Outputs& outputs) {
#define R4_OUTPUT(kind, Value, member, channels, motor) \
  for (auto& channel : outputs.member) {                \
    if (motor) set_value(channel, 0);                   \
  }
#include "r4link/tables/board.def"
  for (StepperTarget& channel : outputs.stepper) channel = StepperTarget();
}

}  // namespace

Refusal carry_out(const Command& command, Setpoints& setpoints) {
  const int i = command.channel - 1;
  const int channels = row_of(command.kind).channels;
  if (channels != 0 && (i < 0 || i >= channels)) return Refusal::channel;  // `i` is an index below
  Outputs& outputs = setpoints.outputs;
  switch (command.kind) {
#define R4_OUTPUT(kind, Value, member, ...) \
  case CommandKind::kind:                   \
    set(outputs.member[i], command);        \
    break;
#include "r4link/tables/board.def"
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
    case CommandKind::proximity:
      set(setpoints.proximity_cm[i], command);
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
    case CommandKind::ask_wiring:
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
