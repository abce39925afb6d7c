# SPDX-License-Identifier: GPL-3.0-or-later
"""The channels of a board: their commands, and how their pins and the state show them."""


def channels(steps):
    """Every channel of the board: the command, the check of its pins, and the field of the state with its value."""
    relays = [(f'R:{n},On', lambda o, n=n: o['relays'] == 2**n - 1, 'RELAYS', None) for n in range(1, 9)]
    return [
        *relays,  # relay 1 closes the motors' supply, which clears the setpoints of the motors
        *((f'O:{1000 + n},1,{n}', lambda o, n=n: o['osmc'][n - 1] == [1000 + n, 1], f'OSMC{n}', f'{1000 + n},1')
          for n in range(1, 5)),
        *((f'D:{2000 + n},0,{n}', lambda o, n=n: o['dhb'][n - 1] == [2000 + n, 0], field, f'{2000 + n},0')
          for n, field in enumerate(('DHB1A', 'DHB1B', 'DHB2A', 'DHB2B'), 1)),
        *((f'S:{600 + 100 * n},{n}', lambda o, n=n: abs(o['servo'][n - 1] - 600 - 100 * n) <= 3,
           f'SERVO{n}POS', f'{600 + 100 * n}') for n in range(1, 17)),
        *((f'B:{3000 + n},1,0,{n}', lambda o, n=n: o['bldc'][n - 1] == [3000 + n, 1, 0], f'BLDC{n}', f'{3000 + n},1,0')
          for n in range(1, 5)),
        *((f'P:{steps * n},2000,{n}', lambda o, n=n: o['stepper'][n - 1] == [steps * n, 0], f'STEP{n}POS', f'{steps * n}')
          for n in range(1, 5)),
    ]
