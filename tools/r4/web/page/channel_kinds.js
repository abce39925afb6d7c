// SPDX-License-Identifier: GPL-3.0-or-later
// The controls of an output, derived from the server's description: its command with placeholders,
// and ranges. `set` holds the user's choice; `of` extracts the same values from the board's report.

export function kind_of({channel, name, command, min, max, speed}) {
  const has = (value) => command.includes(`{${value}}`);
  const wide = max - min > 0xFFFF;  // a position: the slider covers only its middle
  return {
    value: {name, step: 1, min: wide ? -10000 : min, max: wide ? 10000 : max, any: wide},
    direction: has('direction'), brake: has('brake'), toggle: has('switch'), zero: Boolean(speed),
    speed: speed && {name: 'speed in steps/s', ...speed},
    command: (set) => command.replace(/{(\w+)}/g, (_, value) => ({...set, switch: set.value ? 'On' : 'Off'})[value]),
    of: ([value, direction, brake]) => (has('switch') ? {value: (value >> (channel - 1)) & 1} : {value, direction, brake}),
  };
}
