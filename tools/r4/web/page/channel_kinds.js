// SPDX-License-Identifier: GPL-3.0-or-later
// What each kind of output takes, as docs/protocol.md has it, and the command that says so. `channel` is its number,
// `set` what the person chose; `of` reads that back from what the board reports.

const drive = (letter) => ({
  value: {name: 'pwm', min: 0, max: 4095, step: 1}, direction: true,
  command: (channel, set) => `${letter}:${set.value},${set.direction},${channel}`,
  of: ([pwm, direction]) => ({value: pwm, direction}),
});

export const KINDS = {
  osmc: {title: 'OSMC', ...drive('O')},
  dhb12: {title: 'DHB12', ...drive('D')},
  bldc: {
    title: 'BLDC', value: {name: 'speed', min: 0, max: 4095, step: 1}, direction: true, brake: true,
    command: (channel, set) => `B:${set.value},${set.direction},${set.brake},${channel}`,
    of: ([speed, direction, brake]) => ({value: speed, direction, brake}),
  },
  relay: {
    title: 'Relays', toggle: true,
    command: (channel, set) => `R:${channel},${set.value ? 'On' : 'Off'}`,
    of: ([relays], channel) => ({value: (relays >> (channel - 1)) & 1}),
  },
  stepper: {
    title: 'Steppers', value: {name: 'position in steps', min: -10000, max: 10000, step: 1, any: true},
    speed: {name: 'speed in steps/s', min: 1, max: 20000, value: 1000}, zero: true,
    command: (channel, set) => `P:${set.value},${set.speed},${channel}`,
    of: ([steps]) => ({value: steps}),
  },
  servo: {
    title: 'Servos', unit: 'us', value: {name: 'pulse width in us', min: 0, max: 2500, step: 1},
    command: (channel, set) => `S:${set.value},${channel}`,
    of: ([us]) => ({value: us}),
  },
};
