// SPDX-License-Identifier: GPL-3.0-or-later
#include "command_evidence.hpp"

namespace r4 {

namespace {

// The field of channel `channel` in a row of fields that begins with `first` and goes on at
// `second`.
StateField field_of(StateField first, StateField second, int channel) {
  if (channel == 1) return first;
  return static_cast<StateField>(static_cast<int>(second) + channel - 2);
}

}  // namespace

bool state_shows(const State& state, const Command& command) {
  const int channel = command.channel;
  const auto i = static_cast<std::size_t>(channel - 1);
  switch (command.kind) {
    case CommandKind::osmc:
      return state.present.has(field_of(StateField::osmc1, StateField::osmc2, channel)) &&
             state.osmc[i].pwm == command.value && state.osmc[i].direction == command.direction;
    case CommandKind::dhb12:
      return state.present.has(field_of(StateField::dhb1a, StateField::dhb1b, channel)) &&
             state.dhb12[i].pwm == command.value && state.dhb12[i].direction == command.direction;
    case CommandKind::servo:
      return state.present.has(field_of(StateField::servo1pos, StateField::servo2pos, channel)) &&
             state.servo_us[i] == command.value;
    case CommandKind::relay:
      return state.present.has(StateField::relays) &&
             (((state.relays >> i) & 1) != 0) == command.on;
    case CommandKind::stepper:
      return state.present.has(field_of(StateField::step1pos, StateField::step2pos, channel)) &&
             state.stepper_steps[i] == command.value;
    case CommandKind::bldc:
      return state.present.has(field_of(StateField::bldc1, StateField::bldc2, channel)) &&
             state.bldc[i].speed == command.value && state.bldc[i].direction == command.direction &&
             state.bldc[i].brake == command.on;
    case CommandKind::dac:
      return state.present.has(i == 0 ? StateField::dac1 : StateField::dac2) &&
             state.dac_mv[i] == command.value;
    default:
      return false;
  }
}

}  // namespace r4
